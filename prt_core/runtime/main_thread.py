"""Work in a thread, as generators of `Progress`, and calls that it has the main thread do.

Blender's data belong to the main thread: what works beside it asks it by `MainThreadCalls`.
"""

import queue
import threading
from concurrent.futures import Future, ThreadPoolExecutor, wait

from prt_core.runtime.progress import Progress, run
from prt_core.runtime.stillness import as_work, rest, waiting

# How long work in a thread lets its caller wait at most.
_POLL = 0.02


def in_thread(stage, function, *arguments):
    """Run pure numpy work in a thread, as a generator of `Progress` that returns its result.

    For single calls that take long and cannot be cut; `function` must not touch Blender's data.
    """
    (result,) = yield from each_in_thread(stage, (function, *arguments))
    return result


def each_in_thread(stage, *calls):
    """`in_thread` for several calls at once, each in a thread of its own; returns their results.

    Parameters
    ----------
    stage : str
    *calls : tuple
        Of a function and its arguments.
    """
    with ThreadPoolExecutor(len(calls)) as pool:
        futures = [pool.submit(as_work(function), *arguments) for function, *arguments in calls]
        try:
            while _unfinished(futures):
                yield Progress(stage, 0, 0)
        finally:
            with waiting():
                wait(futures)
        return [future.result() for future in futures]


def _unfinished(futures):
    with waiting():
        return wait(futures, _POLL).not_done


def maybe_in_thread(allowed, stage, function, *arguments):
    """`in_thread` where that is allowed, else at once; returns the result."""
    if allowed:
        return (yield from in_thread(stage, function, *arguments))
    return function(*arguments)


class _Stopped(BaseException):
    """The caller of work in a thread wants no more of it."""


class MainThreadCalls:
    """What work in a thread has done by the thread that drives it (see `steps_in_thread`)."""

    def __init__(self):
        self._asked, self._stopped = queue.SimpleQueue(), False
        self._lock = threading.Lock()

    def call(self, function, *arguments):
        """The result of a function that is called in the driving thread; waits for it."""
        call = Future()
        with self._lock:
            if self._stopped:
                raise _Stopped
            self._asked.put((call, function, arguments))
        with waiting():
            return call.result()

    def wake(self):
        """End the wait of `serve`."""
        self._asked.put((Future(), int, ()))

    def serve(self, timeout):
        """Wait for a call, `timeout` seconds at most, and do it."""
        try:
            with waiting():
                call, function, arguments = self._asked.get(timeout=timeout)
        except queue.Empty:
            return
        try:
            call.set_result(function(*arguments))
        except BaseException as error:
            call.set_exception(error)

    def stop(self):
        """Nothing is done any more; who waits for a call is told so."""
        with self._lock:
            self._stopped = True
        while not self._asked.empty():
            self._asked.get()[0].set_exception(_Stopped())


def steps_in_thread(steps, calls, stage):
    """Drive a generator in a thread of its own; the same `Progress`, or less of it, and result.

    Closing it ends `steps` at its next step, and waits for that.

    Parameters
    ----------
    steps : generator of Progress
        Must not touch what belongs to the caller's thread, but by `calls`.
    calls : MainThreadCalls
    stage : str
        Of the first `Progress`.
    """
    latest, stopped = [Progress(stage, 0, 0)], threading.Event()

    def note(progress):
        latest[0] = progress
        rest()
        if stopped.is_set():
            raise _Stopped

    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(as_work(run), steps, note)
        # So that the end of the work wakes the caller as a call does.
        future.add_done_callback(lambda _: calls.wake())
        try:
            while not future.done():
                calls.serve(_POLL)
                yield latest[0]
        finally:
            stopped.set()
            calls.stop()
            with waiting():
                wait([future])
        return future.result()
