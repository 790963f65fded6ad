"""Paces: steps as long as asked for, never cut to nothing by what every call costs."""

import time

from prt_core.progress import Pace


def test_a_dear_call_is_not_cut_ever_smaller():
    pace, sizes = Pace(0.001, 64), []
    for _ in range(6):
        for part in pace.parts(0, 200):
            time.sleep(0.004)
            sizes.append(part.stop - part.start)
            pace.worked()
    assert min(sizes[:-1]) >= 200 % 64 and sizes.count(64) >= 18


def test_parts_cover_everything_once_and_grow_while_they_are_quick():
    pace, ends = Pace(10.0, 8), [0]
    for part in pace.parts(0, 1000):
        assert part.start == ends[-1]
        ends.append(part.stop)
        pace.worked()
    assert ends[-1] == 1000 and len(ends) < 12
    assert [part for part in Pace().parts(3, 9)] == [slice(3, 9)]
