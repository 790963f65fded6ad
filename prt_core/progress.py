"""Long work is a generator that yields `Progress` and returns its result; closing it cancels."""

from dataclasses import dataclass


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
