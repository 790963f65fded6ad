"""Threads that keep still while the main thread needs them to."""

import threading
import time

import pytest

from prt_core.runtime import stillness
from prt_core.runtime.main_thread import MainThreadCalls, each_in_thread, steps_in_thread
from prt_core.runtime.progress import Progress, run
from prt_core.runtime.stillness import others_still
from prt_core.runtime.threads import on_all_cores, started


@pytest.fixture(autouse=True)
def needed(monkeypatch):
    """Also with a Python that does not need it."""
    monkeypatch.setattr(stillness, "_NEEDED", True)


def counting(counts, n=40):
    for done in range(n):
        counts.append(done)
        time.sleep(0.002)
        yield Progress("count", done, n)


def on_pool(counts, n=20):
    for done in range(n):
        on_all_cores(lambda _: (time.sleep(0.001), counts.append(0)), range(4))
        yield Progress("count", done, n)


def asking(counts, calls, n=20):
    for done in range(n):
        calls.call(counts.append, done)
        yield Progress("count", done, n)


def nested(counts, n=40):
    yield from steps_in_thread(counting(counts, n), MainThreadCalls(), "inner")


def looked_at(counts, steps):
    """Drive steps, and look between them whether anything is counted where nothing should be."""
    looks, before = 0, len(counts)
    for _ in steps:
        with others_still():
            before = len(counts)
            time.sleep(0.01)
            assert len(counts) == before
        looks += 1
    return looks


@pytest.mark.parametrize(("work", "n"), [(counting, 40), (on_pool, 80), (nested, 40)])
def test_steps_in_a_thread_stop_where_they_can(work, n):
    counts = []
    assert looked_at(counts, steps_in_thread(work(counts), MainThreadCalls(), "count"))
    assert len(counts) == n


def test_a_thread_that_asks_the_main_thread_is_still_meanwhile():
    counts, calls = [], MainThreadCalls()
    assert looked_at(counts, steps_in_thread(asking(counts, calls), calls, "count"))
    assert len(counts) == 20


def test_a_single_piece_of_work_is_waited_for():
    ends = []

    def busy():
        time.sleep(0.1)
        ends.append(time.perf_counter())

    steps = each_in_thread("work", (busy,), (busy,))
    next(steps)
    with others_still():
        assert len(ends) == 2
    run(steps)


def test_work_begins_when_others_need_not_keep_still():
    counts, pieces = [], []
    with others_still():
        giver = threading.Thread(target=lambda: pieces.extend(started(counts.append, range(4))))
        giver.start()
        giver.join()
        time.sleep(0.05)
        assert not counts
    for piece in pieces:
        piece.result(5)
    assert sorted(counts) == [0, 1, 2, 3]


def test_who_others_keep_still_for_works_meanwhile():
    """While all threads are held by pieces that wait for it."""
    held = []
    with others_still():
        giver = threading.Thread(target=lambda: held.extend(started(abs, range(-8, 0))))
        giver.start()
        giver.join()
        assert on_all_cores(abs, range(-3, 0)) == [3, 2, 1]
        calls = (on_all_cores, abs, range(-2, 0)), (abs, -2)
        assert run(each_in_thread("work", *calls)) == [[2, 1], 2]
    assert [piece.result(5) for piece in held] == list(range(8, 0, -1))


def test_steps_that_are_closed_while_others_keep_still_end():
    counts = []
    steps = steps_in_thread(counting(counts, 1000), MainThreadCalls(), "count")
    next(steps)
    with others_still():
        closer = threading.Thread(target=steps.close)
        closer.start()
        time.sleep(0.05)
        still = len(counts)
        time.sleep(0.02)
        assert len(counts) == still
    closer.join(5)
    assert not closer.is_alive() and len(counts) < 1000


def test_work_goes_on_after_an_error_in_it():
    def fails():
        raise ValueError("lost")

    with pytest.raises(ValueError, match="lost"):
        run(each_in_thread("work", (fails,)))
    with others_still():
        pass
