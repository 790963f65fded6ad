"""Which method, and which of its settings: tried on a sample of the points.

Each method's ladder is bisected, on patches of neighbouring points or on an even sample, under a
few lights, for the rung where it is near enough or too large or too slow for what was asked.
"""

import time
from dataclasses import asdict, dataclass

import numpy as np

from prt_core.compress.methods import method_named
from prt_core.errors import expect
from prt_core.progress import Progress, beside

_POINTS, _PATCHES, _FEW = 3072, 12, 64
# Lights are timed so often; what is slower than this (ms) is not live.
_REPEATS, _LIVE = 3, 33.0
# The worst light may be so many times further off than all are in the mean.
WORST = 2.0
# So near a form must be under the few lights that choose: under all of them, at other rotations,
# errors were up to a fifth larger.
_SPARE = 0.8


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
            high = 1 if name == "tolerance" else np.inf
            expect(
                value is None or (np.isfinite(value) and 0 < value < high),
                f"{name}: expected a number above 0{' and below 1' if high == 1 else ''}, "
                f"got {value}",
            )
        expect(any(value is not None for value in asdict(self).values()), "limits: give one")

    def near(self, trial):
        """Whether the tolerance will be kept; True where none was asked for."""
        wanted = None if self.tolerance is None else _SPARE * self.tolerance
        return wanted is None or (trial.error <= wanted and trial.worst <= WORST * wanted)

    def excess(self, trial):
        """How many times over the limits of size and time, 1 or less: within."""
        parts = [(trial.megabytes, self.megabytes), (trial.milliseconds, self.milliseconds)]
        return max((a / b for a, b in parts if b is not None), default=0.0)


@dataclass
class Trial:
    """One rung on the sample; size and time are what all points would need.

    Attributes
    ----------
    method, settings : str
    rung : int
    error, worst : float
        Relative L2 of relit colours, in the mean over the lights and under the worst.
    megabytes, milliseconds, seconds : float
    """

    method: str
    settings: str
    rung: int
    error: float
    worst: float
    megabytes: float
    milliseconds: float
    seconds: float


def choose_steps(task, names, limits, lights):
    """Try methods on a sample; a generator of `Progress`.

    Parameters
    ----------
    task : Task
    names : sequence of str
    limits : Limits
    lights : dict of str -> (n_directions, 3) float32

    Returns
    -------
    chosen : Trial
    why : str
        In a few words.
    trials : list of Trial
        All that was tried.
    """
    yield from task.rows.prepare_steps()
    truths = {}
    for name, light in lights.items():
        truths[name] = yield from beside("choice", task.transport.relight, light)
    trials = []
    for patches in (_PATCHES, None):
        some = [n for n in names if method_named(n).local == (patches is not None)]
        if some:
            points = yield from beside("choice", task.sample, _POINTS, patches)
            part, here = task.some(points), {n: truth[points] for n, truth in truths.items()}
            for name in some:
                trials += yield from _climb(task, part, name, limits, lights, here)
                yield Progress("choice", len({t.method for t in trials}), len(names))
    expect(trials, f"method: none of {', '.join(names)} can compress this bake")
    return *_best(trials, limits), trials


def _climb(task, part, name, limits, lights, truths):
    """Trials of one method: by bisection of its ladder, to the rung where a limit is crossed."""
    method, trials = method_named(name), []
    ladder, whole = method.ladder(part), method.ladder(task)
    start = yield from _start(part, method, lights)
    low, high = 0, len(ladder)
    while low < high:
        rung = (low + high) // 2
        model, began = ladder[rung], time.perf_counter()
        yield from model.fit_steps(part.rows)
        seconds = time.perf_counter() - began
        quick = method.relighter(model, part.transport)
        errors, spent = yield from beside("choice", relit, quick, lights, truths)
        scale = task.n_points / part.n_points
        trial = Trial(
            name,
            describe(whole[rung]),
            rung,
            float(np.mean(errors)),
            max(errors),
            method.size(model, task.n_points) / 1e6,
            1e3 * (start + max(spent - start, 0) * scale),
            seconds,
        )
        trials.append(trial)
        enough = limits.near(trial) if limits.tolerance is not None else False
        if enough or limits.excess(trial) > 1:
            high = rung
        else:
            low = rung + 1
    return sorted(trials, key=lambda trial: trial.rung)


def _start(part, method, lights):
    """Seconds that a light costs however few the points are."""
    few = part.some(np.arange(min(part.n_points, _FEW)))
    model = method.ladder(few)[0]
    yield from model.fit_steps(few.rows)
    quick = method.relighter(model, few.transport)
    return min((yield from beside("choice", _times, quick, lights)))


def relit(quick, lights, truths):
    """Errors under each light, and the least time of one."""
    errors = [relative_l2(quick.relight(light), truths[name]) for name, light in lights.items()]
    return errors, min(_times(quick, lights))


def _times(quick, lights):
    """Seconds of each light, some of them again."""
    spent = []
    for _ in range(_REPEATS):
        for light in lights.values():
            start = time.perf_counter()
            quick.relight(light)
            spent.append(time.perf_counter() - start)
    return spent


def relative_l2(found, truth):
    """Relative L2 distance, in float64."""
    size = np.linalg.norm(np.asarray(truth, np.float64))
    distance = np.linalg.norm(np.asarray(found, np.float64) - truth)
    return float(distance / size) if size else float(distance > 0)


def _best(trials, limits):
    """The trial to take, and why."""
    within = [t for t in trials if limits.excess(t) <= 1]
    good = [t for t in within if limits.near(t)]
    if limits.tolerance is not None and good:
        # By size: times differ from run to run, and the same seed is to choose the same.
        live = [t for t in good if t.milliseconds <= _LIVE] or good
        best = min(live, key=lambda t: t.megabytes)
        return best, f"the smallest of {len(live)} that keep the tolerance at 30 frames a second"
    if within:
        best = min(within, key=lambda t: t.error)
        if limits.tolerance is not None:
            return best, "nothing tried keeps the tolerance; this is the nearest"
        return best, f"the least error of {len(within)} within the limit"
    return min(trials, key=limits.excess), "nothing tried is within the limit; this is the nearest"


def describe(model):
    """An estimator's settings that are not the default, and its main ones, in a few words."""
    return ", ".join(f"{k}={_short(v)}" for k, v in model.get_params().items() if _plain(k, v))


def _plain(key, value):
    return key not in ("seed", "memory") and isinstance(value, int | float | str)


def _short(value):
    return f"{value:.3g}" if isinstance(value, float) else str(value)
