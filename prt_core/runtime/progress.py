"""Long work is a generator that yields `Progress` and returns its result; closing it cancels."""

import time
from dataclasses import dataclass

from prt_core.errors import expect, expect_offers, shown

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
    expect_offers("steps", steps, ("__next__", "close"), "a generator of Progress")
    expect(report is None or callable(report), f"report: expected a function, got {shown(report)}")
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
    """

    def __init__(self, seconds=None, first=16):
        self.seconds, self._units, self._fewest = seconds, float(first), float(first)

    def parts(self, start, stop, whole=1):
        """Slices from `start` to `stop`, of whole groups of `whole` units."""
        while start < stop:
            groups = max(1, int(self._units) // whole)
            count = stop - start if self.seconds is None else groups * whole
            end = min(start + count, stop)
            self._began, self._count = time.perf_counter(), end - start
            yield slice(start, end)
            start = end

    def worked(self, spent=None):
        """The part is done: how long it took, in seconds, decides how large the next one is."""
        if self.seconds is not None:
            spent = time.perf_counter() - self._began if spent is None else spent
            wanted = self._count * self.seconds / max(spent, 1e-6)
            self._units = max(min(max(wanted, self._units / 4), self._units * 2), self._fewest)


class DearPace(Pace):
    """A pace of calls that each take a while however little they do, such as renders.

    What the quickest one took is what each costs. Work has the rest of the seconds, and at least
    as long as that: no more than half of the time goes into what the calls cost.

    Parameters
    ----------
    seconds : float
        Of a step.
    first : int
        Units of the first step, and the fewest of any but the last.
    """

    def __init__(self, seconds, first):
        super().__init__(seconds, first)
        self._asked, self._least = seconds, float("inf")

    def worked(self, spent=None):
        """See `Pace.worked`."""
        spent = time.perf_counter() - self._began if spent is None else spent
        self._least = min(self._least, spent)
        self.seconds = max(self._asked - self._least, self._least)
        super().worked(spent - self._least)
