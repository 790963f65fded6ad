"""Which method, and which of its settings: tried on a sample of the points.

Each method's budgets are bisected, on patches of neighbouring points or on an even sample, under a
few lights, for the one where it is near enough or too large or too slow for what was asked. A
budget that fails is out of the race and says why; the others go on. Methods that are seldom
the best are tried only where none of the others keeps what was asked for.
"""

import time
from dataclasses import asdict, dataclass

import numpy as np

from prt_core.compress.choice.methods import Task, describe, method_from_text
from prt_core.errors import (
    PRTError,
    expect,
    expect_all,
    expect_kind,
    expect_named,
    expect_number,
)
from prt_core.light.environment import expect_radiance
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import Progress

_POINTS, _PATCHES, _FEW = 3072, 12, 64
# Lights are timed so often; what is slower than this (ms) is not live.
_REPEATS, _LIVE = 3, 33.0
# The worst light may be so many times further off than all are in the mean.
WORST = 2.0
# Errors of all points were up to so many times those of an even sample. On patches, which clusters
# fill less well, they were smaller.
_GROWTH = 1.12
# Sizes and times of all points are told from a sample so far as to try what seems too much.
_DOUBT = 1.25
# How a candidate may fail without ending the choice.
FAILURES = (PRTError, np.linalg.LinAlgError, MemoryError, ArithmeticError, OSError)


@dataclass(frozen=True)
class Limits:
    """What a compressed form has to keep.

    Attributes
    ----------
    tolerance : float or None
        Relative L2 of relit colours in the mean over lights; of the worst, twice that.
    megabytes, milliseconds : float or None
        Size of what relighting reads, and time of one new light.
    """

    tolerance: float | None = None
    megabytes: float | None = None
    milliseconds: float | None = None

    def __post_init__(self):
        for name, value in asdict(self).items():
            if value is not None:
                expect_number(name, value, above=0, below=1 if name == "tolerance" else None)
        expect(any(value is not None for value in asdict(self).values()), "limits: give one")

    def near(self, trial):
        """Whether a trial will keep the tolerance; True where none was asked for."""
        if self.tolerance is None:
            return True
        wanted = self.tolerance / trial.growth
        return trial.error <= wanted and trial.worst <= WORST * wanted

    def excess(self, trial):
        """How many times over the limits of size and time a trial is, 1 or less: within."""
        parts = [(trial.megabytes, self.megabytes), (trial.milliseconds, self.milliseconds)]
        return max((a / b for a, b in parts if b is not None), default=0.0)

    def beyond(self, trials):
        """What is said where none of these trials is within the limits of size and time."""
        parts = []
        for name, unit in (("megabytes", "MB"), ("milliseconds", "ms")):
            limit = getattr(self, name)
            if limit is not None:
                least = min(trials, key=lambda trial, name=name: getattr(trial, name))
                parts.append(
                    f"{name}: {limit:g} cannot be kept; the least is {getattr(least, name):.3g} "
                    f"{unit}, by {least.method} ({least.settings})"
                )
        both = " and not both at once" if len(parts) > 1 else ""
        return f"{', '.join(parts)}{both}; ask for more. Nothing was stored"


@dataclass
class Trial:
    """One budget on the sample; size and time are what all points would need.

    Attributes
    ----------
    method, settings : str
    budget : int
    error, worst : float or None
        Relative L2 of relit colours, in the mean over the lights and under the worst. These and
        the following are None where it failed.
    megabytes, milliseconds, seconds : float or None
    failure : str
        Why it is out of the race; empty where it is not.
    work : float or None
        Numbers that a light is multiplied with (see `Method`).
    growth : float
        What the error is expected to be of all points, in units of `error`.
    """

    method: str
    settings: str
    budget: int
    error: float | None = None
    worst: float | None = None
    megabytes: float | None = None
    milliseconds: float | None = None
    seconds: float | None = None
    failure: str = ""
    work: float | None = None
    growth: float = 1.0


def choose_steps(task, names, limits, lights):
    """Try methods on a sample; a generator of `Progress`.

    Parameters
    ----------
    task : Task
    names : sequence of str
        NAME or NAME:key=value,key=value, each name once.
    limits : Limits
    lights : dict of str -> (n_directions, 3) float32

    Returns
    -------
    ranked : list of (Trial, str)
        Those that may be taken, the best first, and in a few words why.
    trials : list of Trial
        All that was tried; none where there is but one setting of one method.

    Raises
    ------
    PRTError
        All failed, or none is within the limits of size and time: the message says what is the
        least.
    """
    expect_kind("task", task, Task)
    expect_kind("limits", limits, Limits)
    names = expect_all("names", names, str, "methods' names")
    expect(names, "names: expected at least one method")
    methods = [method_from_text(name) for name in names]
    expect(
        len({method.name for method in methods}) == len(methods),
        f"names: expected each method once, got {', '.join(names)}",
    )
    lights = {
        name: expect_radiance(f"lights: {name}", light, task.transport.cube_map)
        for name, light in expect_named("lights", lights, object, "lights").items()
    }
    expect(lights, "lights: expected at least one")
    # What cannot be is said before the work; nothing is chosen of one setting, which is measured.
    budgets = methods[0].budgets(task) if len(methods) == 1 else ()
    yield from task.rows.prepare_steps()
    if len(budgets) == 1:
        return [(Trial(methods[0].name, describe(budgets[0]), 0), "all that was asked for")], []
    truths = yield from in_thread("choice", task.colours, lights)
    trials, samples = [], {}
    for first in (True, False):
        for method in (m for m in methods if m.first(task) == first):
            if method.local not in samples:
                patches = _PATCHES if method.local else None
                points = yield from in_thread("choice", task.sample, _POINTS, patches)
                here = {name: truth[points] for name, truth in truths.items()}
                samples[method.local] = task.some(points), here
            part, here = samples[method.local]
            try:
                trials += yield from _climb(task, part, method, limits, lights, here)
            except FAILURES as error:
                trials.append(Trial(method.name, "", 0, failure=reason_of(error)))
            yield Progress("choice", len({t.method for t in trials}), len(methods))
        if any(_will_do(trial, limits) for trial in trials):
            break
    good = [trial for trial in trials if not trial.failure]
    expect(good, none_left(trials))
    ranked = _ranked(good, limits)
    expect(ranked, limits.beyond(good))
    return ranked, trials


def none_left(trials):
    """What is said where all trials failed."""
    reasons = {trial.method: trial.failure for trial in trials if trial.failure}
    reasons_line = "; ".join(f"{name}: {reason}" for name, reason in reasons.items())
    return f"method: none of {len(reasons)} can compress this bake. {reasons_line}"


def reason_of(error):
    """Why a candidate failed, on one line."""
    return " ".join(str(error).split()) or type(error).__name__


def _climb(task, part, method, limits, lights, truths):
    """Trials of one method: by bisection of its budgets, to the budget where a limit is crossed."""
    trials = []
    budgets, whole = method.budgets(part), method.budgets(task)
    start = yield from _start(part, method, lights)
    low, high = 0, len(budgets)
    while low < high:
        budget = (low + high) // 2
        growth = 1.0 if method.local else _GROWTH
        trial = Trial(method.name, describe(whole[budget]), budget, growth=growth)
        try:
            yield from _try(trial, budgets[budget], method, task, part, lights, truths, start)
            near = limits.tolerance is not None and limits.near(trial)
            enough = near or limits.excess(trial) > 1
        except FAILURES as error:
            trial.failure = reason_of(error)
            # A nearer one needs more memory still; of other failures nobody knows.
            enough = isinstance(error, MemoryError)
        trials.append(trial)
        low, high = (low, budget) if enough else (budget + 1, high)
    return sorted(trials, key=lambda trial: trial.budget)


def _try(trial, model, method, task, part, lights, truths, start):
    """Fit a budget to the sample and fill in its `Trial`."""
    began = time.perf_counter()
    yield from model.fit_steps(part.rows)
    trial.seconds = time.perf_counter() - began
    evaluator = method.evaluator(model, part.subject.read_bits)
    errors, spent = yield from in_thread("choice", relit, evaluator, part.subject, lights, truths)
    scale = task.n_points / part.n_points
    trial.error, trial.worst = float(np.mean(errors)), max(errors)
    trial.megabytes = method.size(model, task.n_points) / 1e6
    trial.milliseconds = 1e3 * (start + max(spent - start, 0) * scale)
    trial.work = method.work(model, task.n_points)


def _start(part, method, lights):
    """Seconds that a light costs however few the points are."""
    few = part.some(np.arange(min(part.n_points, _FEW)))
    failure = None
    for model in method.budgets(few):
        try:
            yield from model.fit_steps(few.rows)
        except FAILURES as error:
            failure = error
            continue
        evaluator = method.evaluator(model, few.subject.read_bits)
        return min((yield from in_thread("choice", _times, evaluator, few.subject, lights)))
    raise failure


def relit(evaluator, subject, lights, truths):
    """Errors of colours under each light, and the least time of one.

    Raises
    ------
    PRTError
        The colours are not finite.
    """
    errors = [
        relative_l2(radiance_of(evaluator, subject, light), truths[name])
        for name, light in lights.items()
    ]
    bad = [name for name, error in zip(lights, errors, strict=True) if not np.isfinite(error)]
    expect(not bad, f"its colours are not finite under {', '.join(bad)}")
    return errors, min(_times(evaluator, subject, lights))


def radiance_of(form, subject, light):
    """(n_rows, 3) float32: what a `form` of a `Subject` shows under a `light`."""
    return subject.radiance(form.product(light))


def _times(evaluator, subject, lights):
    """Seconds of each light, some of them again."""
    spent = []
    for _ in range(_REPEATS):
        for light in lights.values():
            start = time.perf_counter()
            radiance_of(evaluator, subject, light)
            spent.append(time.perf_counter() - start)
    return spent


def relative_l2(values, truth):
    """Relative L2 distance, in float64."""
    size = np.linalg.norm(np.asarray(truth, np.float64))
    distance = np.linalg.norm(np.asarray(values, np.float64) - truth)
    return float(distance / size) if size else float(distance > 0)


def _will_do(trial, limits):
    """Whether a trial keeps the tolerance, within the limits."""
    asked = not trial.failure and limits.tolerance is not None
    return asked and limits.near(trial) and limits.excess(trial) <= 1


def _is_live(trial):
    return trial.milliseconds <= _LIVE


def _ranked(trials, limits):
    """Trials that may be within the limits with the reason to take each, the best first."""
    within = [t for t in trials if limits.excess(t) <= 1]
    good = [t for t in within if limits.tolerance is not None and limits.near(t)]
    live = [t for t in good if _is_live(t)] or good
    if good:
        why = f"the smallest and quickest of {len(live)} that keep the tolerance"
    elif limits.tolerance is not None:
        why = "nothing tried keeps the tolerance; this is the nearest"
    else:
        why = f"the least error of {len(within)} within the limit"
    # By work, not by time, which differs from run to run: the same seed is to choose the same.
    first = sorted(live, key=lambda t: t.megabytes * t.work)
    rest = sorted((t for t in within if t not in live), key=lambda t: t.error)
    doubtful = sorted((t for t in trials if 1 < limits.excess(t) <= _DOUBT), key=limits.excess)
    ranked = [*first, *rest, *doubtful]
    return [(t, why if i == 0 else "the best that is left") for i, t in enumerate(ranked)]
