"""Short pieces of array work on all cores, by threads that are kept."""

import threading
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache

from prt_core.runtime.cores import n_cores
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.stillness import as_work, keeps_others_still, rest, waiting

_here = threading.local()


def on_all_cores(function, items):
    """`[function(item) for item in items]`, on all cores.

    To start threads for each of thousands of calls took longer than some of the calls. A piece
    that calls this itself does its part alone, for all threads may be waiting for such pieces.

    Parameters
    ----------
    function : callable
        Should spend its time in numpy or another caller that releases the interpreter.
    items : iterable
    """
    items = list(items)
    if works_alone(items):
        return [function(item) for item in items]
    results, turns = [None] * len(items), iter(range(len(items)))

    def takes_turns(_):
        # To hand out thousands of items one by one took longer than to work on some.
        for index in turns:
            rest()
            results[index] = function(items[index])

    with one_blas_thread():
        pieces = started(takes_turns, range(min(n_cores(), len(items))))
        # Also where one fails: what they work on may be closed as soon as this returns.
        with waiting():
            wait(pieces)
    for piece in pieces:
        piece.result()
    return results


def works_alone(items):
    """Whether pieces of work are done where they are asked for, one after the other."""
    # All threads may be held by pieces that keep still for this one.
    return len(items) < 2 or getattr(_here, "inside", False) or keeps_others_still()


def started(function, items):
    """A `concurrent.futures.Future` for `function(item)` of each, begun on all cores."""
    return [_pool().submit(as_work(_inside), function, item) for item in items]


@cache
def _pool():
    return ThreadPoolExecutor(n_cores(), "prt")


def _inside(function, item):
    _here.inside = True
    try:
        return function(item)
    finally:
        _here.inside = False
