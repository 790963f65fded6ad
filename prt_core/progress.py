"""Long work is a generator that yields `Progress` and returns its result; closing it cancels."""

import time
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass

# How long `beside` lets its caller wait at most.
_POLL = 0.02
# Seconds that a stop may have to wait for threads.
STOP = 0.1


@dataclass(frozen=True)
class Progress:
    """How far a stage of the work is: `done` of `total` units (points, rays, files)."""

    stage: str
    done: int
    total: int


def run(steps, report=None):
    """Drive the generator `steps` to its end and return its result.

    Parameters
    ----------
    steps : generator of Progress
    report : callable(Progress), optional
        Called after each step; what it raises ends the work and reaches the caller.
    """
    while True:
        try:
            progress = next(steps)
        except StopIteration as end:
            return end.value
        if report is not None:
            try:
                report(progress)
            except BaseException:
                steps.close()
                raise


class Pace:
    """Cuts work into steps that take about as long as asked for.

    The results do not depend on it: only where the work pauses does. Between a part and the
    next the worker calls `worked` before it yields, so that others' time is not counted.

    Parameters
    ----------
    seconds : float, optional
        Of a step; None: no cuts.
    first : int
        Units of the first step, until the speed is known, and the fewest of any but the last: a
        call that costs more than it does for a single unit must not be cut ever smaller.
    apart : bool
        Whether the parts may be worked on beside the caller (see `maybe_beside`); then nobody
        but a stop waits for a part, and where `seconds` are given a part lasts `STOP`.
    """

    def __init__(self, seconds=None, first=16, apart=False):
        self.apart = apart and seconds is not None
        seconds = STOP if self.apart else seconds
        self.seconds, self._units, self._fewest = seconds, float(first), float(first)

    def parts(self, start, stop):
        """Slices from `start` to `stop`."""
        while start < stop:
            count = stop - start if self.seconds is None else max(1, int(self._units))
            end = min(start + count, stop)
            self._began, self._count = time.perf_counter(), end - start
            yield slice(start, end)
            start = end

    def worked(self):
        """The part is done: how long it took decides how large the next one is."""
        if self.seconds is not None:
            spent = max(time.perf_counter() - self._began, 1e-6)
            wanted = self._count * self.seconds / spent
            self._units = max(min(max(wanted, self._units / 4), self._units * 2), self._fewest)


def beside(stage, function, *arguments):
    """Run pure numpy work in a thread, as a generator of `Progress` that returns its result.

    For single calls that take long and cannot be cut; `function` must not touch Blender's data.
    """
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(function, *arguments)
        while not wait([future], _POLL).done:
            yield Progress(stage, 0, 0)
        return future.result()


def maybe_beside(allowed, stage, function, *arguments):
    """`beside` where that is allowed, else at once; returns the result."""
    if allowed:
        return (yield from beside(stage, function, *arguments))
    return function(*arguments)
