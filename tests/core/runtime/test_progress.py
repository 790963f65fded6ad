"""Paces: steps as long as asked for, never cut to nothing by what every call costs."""

import threading
import time

import pytest

from prt_core.runtime.main_thread import MainThreadCalls, steps_in_thread
from prt_core.runtime.progress import DearPace, Pace, Progress, run


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


def test_parts_are_of_whole_groups():
    pace = Pace(10.0, 20)
    parts = []
    for part in pace.parts(0, 70, 7):
        parts.append(part)
        pace.worked(10.0 * (part.stop - part.start) / 20)
    assert parts == [slice(n, n + 14) for n in range(0, 70, 14)]
    assert list(Pace(1.0, 3).parts(0, 20, 10)) == [slice(0, 10), slice(10, 20)]


@pytest.mark.parametrize(("each", "low", "high"), [(0.1, 0.9, 1.1), (0.7, 1.6, 1.9), (3, 5, 6.6)])
def test_calls_that_cost_much_themselves_do_at_least_as_much_work(each, low, high):
    """Seconds of a call: what each costs, and 5 microseconds a path."""
    pace, spent = DearPace(1.0, 1 << 14), []
    for part in pace.parts(0, 1 << 24, 1 << 9):
        # The first call is slow: what it needs is read from the disk.
        spent.append(each + 5e-6 * (part.stop - part.start) + (not spent))
        pace.worked(spent[-1])
    assert max(spent[1:]) < high and min(spent[10:-1]) > low


def steps(ended, calls=None, n=200, fails=False):
    """Steps that note in which threads they ran, and that they ended."""
    try:
        for done in range(n):
            time.sleep(0.001)
            yield Progress("steps", done, n)
        if fails:
            raise ValueError("lost")
        return threading.get_ident(), calls and calls.call(threading.get_ident)
    finally:
        ended.append(threading.get_ident())


def test_work_beside_runs_in_another_thread_and_its_errands_in_this_one():
    calls, ended, shown = MainThreadCalls(), [], []
    worker, served = run(steps_in_thread(steps(ended, calls), calls, "first"), shown.append)
    assert served == threading.get_ident() != worker and ended == [worker]
    assert shown[0].stage in ("first", "steps") and shown[-1].done > 100
    done = [progress.done for progress in shown]
    assert done == sorted(done)


def test_work_beside_ends_when_it_is_closed_and_hands_on_what_it_raises():
    calls, ended = MainThreadCalls(), []
    work = steps_in_thread(steps(ended, n=10**9), calls, "first")
    for _ in range(3):
        next(work)
    start = time.perf_counter()
    work.close()
    assert len(ended) == 1 and time.perf_counter() - start < 5
    with pytest.raises(ValueError, match="lost"):
        run(steps_in_thread(steps(ended, n=1, fails=True), MainThreadCalls(), "first"))


def test_an_errand_that_nobody_does_any_more_does_not_wait():
    """The caller closes the work while it waits for the caller."""
    calls, waits, ended = MainThreadCalls(), threading.Event(), []

    def work():
        try:
            waits.set()
            yield Progress("call", 0, 1)
            while True:
                calls.call(int)
        finally:
            ended.append(True)

    beside = steps_in_thread(work(), calls, "first")
    next(beside)
    waits.wait()
    time.sleep(0.05)
    beside.close()
    assert ended == [True]
