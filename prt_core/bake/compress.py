"""The compressed form of a bake: chosen, made, measured under lights new to it, stored."""

import platform
import time
from dataclasses import asdict, dataclass, replace

import numpy as np

from prt_core.bake.compress_gloss import (
    GLOSS_METHODS,
    WIDE,
    compress_gloss_steps,
    expect_gloss_method,
    widest_needed,
)
from prt_core.bake.measure import measure_steps, met, new_lights, standing_lights
from prt_core.compress import (
    Limits,
    Task,
    candidate_names,
    choose_steps,
    method_from_text,
    method_names,
)
from prt_core.compress.choice.choose import (
    FAILURES,
    Trial,
    none_left,
    reason_of,
)
from prt_core.compress.choice.methods import describe, settings_of
from prt_core.compress.gloss_transfer import GlossTransfer
from prt_core.compress.subject import Subject
from prt_core.errors import (
    PRTError,
    expect,
    expect_kind,
    expect_named,
    expect_offers,
    expect_one_of,
    expect_seed,
    shown,
    system_errors,
)
from prt_core.light import EnvironmentMap, TurningLight
from prt_core.relight.fixed_view import FixedView
from prt_core.relight.forms import CompressedForm
from prt_core.relight.relighter import Relighter
from prt_core.runtime.machine import peak_bytes
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import Progress
from prt_core.store import BakeStore, write_compressed
from prt_core.version import __version__

# Degrees about z of the lights that a method is chosen under.
_CHOICE = 20.0
_CHOICE_LIGHTS, _TURNS = 8, 2


@dataclass(frozen=True)
class CompressSettings:
    """What a compressed form is to be.

    Parameters
    ----------
    method : str
        `auto`, or a registered method (`compress.method_names()`), or one of `GLOSS_METHODS` for
        what views show of gloss; settings of its own that are
        to be the same at all its budgets as NAME:key=value,key=value.
    tolerance : float, optional
        Relative L2 error of relit colours: in the mean over lights, and twice that under the
        worst of them. Default 0.01 where nothing else is asked for.
    megabytes : float, optional
        Of what relighting reads.
    milliseconds : float, optional
        For all points under a new light.
    seed : int
    of : {"auto", "points", "image"}
        What is compressed: a bake's points, or the pixels of its image. `auto`: the image where
        the bake holds one.
    """

    method: str = "auto"
    tolerance: float | None = None
    megabytes: float | None = None
    milliseconds: float | None = None
    seed: int = 0
    of: str = "auto"

    def __post_init__(self):
        expect_one_of("of", self.of, ("auto", "points", "image"))
        good = isinstance(self.method, str)
        name, names = self.method.partition(":")[0] if good else None, method_names()
        expect_gloss_method(name)
        names = [*names, *GLOSS_METHODS]
        expect(
            good and (self.method == "auto" or name in names),
            f"method: expected auto, {', '.join(names)} or none, got {shown(self.method)}",
        )
        if self.of_gloss:
            GlossTransfer.from_text(self.method)
        elif name != "auto":
            method_from_text(self.method)
        expect_seed(self.seed)
        self.limits  # noqa: B018  (checks them)

    @property
    def of_gloss(self):
        """Whether it is what views show of gloss that is compressed."""
        return self.method.partition(":")[0] in GLOSS_METHODS

    @property
    def limits(self):
        """The `Limits` that were asked for."""
        asked = self.tolerance, self.megabytes, self.milliseconds
        return Limits(0.01) if asked == (None, None, None) else Limits(*asked)


def compress_steps(bake, settings=None, lights=None):
    """Compress a bake and store that beside it; a generator of `Progress`.

    Parameters
    ----------
    bake : Bake
        As `load` gives it.
    settings : CompressSettings
    lights : dict of str -> EnvironmentMap, optional
        Some of them, turned, choose; all, turned otherwise, measure. Default: three skies without
        and with a sun.

    Returns
    -------
    dict
        The attributes that are stored: method, of ("points" or "image"), settings, why, trials,
        bytes, bits_a_coefficient, seconds, milliseconds, milliseconds_worst, error, worst,
        worst_light, lights, tolerance, tolerance_met, matrix_l2, seam, peak_bytes, fingerprint,
        versions; rows_error where pixels show gloss.
    """
    settings = CompressSettings() if settings is None else settings
    expect_kind("settings", settings, CompressSettings)
    expect_offers("bake", bake, ("scene", "transport", "path"), "what `load` returns")
    lights = _expect_lights(lights)
    with system_errors(bake.path):
        expect(bake.path is not None, "bake: is not on disk; load it from its folder NAME.prt")
        if settings.of_gloss:
            return (yield from compress_gloss_steps(bake, settings, lights))
        report = yield from _compress(bake, settings, lights)
        tries = settings.method == "auto" and report["of"] == "points" and bake.reflections
        if not tries or widest_needed(bake) < WIDE:
            return report
        # What moves beside the light is the view: harmonics where they are near enough.
        wanted = replace(settings, method=GLOSS_METHODS[0])
        gloss = yield from compress_gloss_steps(bake, wanted, lights, only_within=True)
        return {**report, "gloss": gloss}


def _expect_lights(lights):
    """Environments by name; the standing ones where none are given."""
    if lights is None:
        return standing_lights()
    expect_named("lights", lights, EnvironmentMap, "environments")
    expect(lights, "lights: expected at least one")
    return lights


def _compress(bake, settings, lights):
    began = time.perf_counter()
    task = _task(bake, settings)
    names = candidate_names() if settings.method == "auto" else [settings.method]
    if task.dense is not None and settings.method == "auto":
        # Clusters of the points that are known best, and the others after them.
        names = ["sparse_cpca" if name == "cpca" else name for name in names]
    turning = yield from in_thread("lights", _turning, lights, bake.cube_map)
    few = list(turning.items())[:: max(1, len(turning) // _CHOICE_LIGHTS)]
    few = {name: light.at(_CHOICE) for name, light in few}
    limits = settings.limits
    ranked, trials = yield from choose_steps(task, names, limits, few)
    relighter = Relighter(bake, form="exact") if task.subject.shows_gloss else None
    try:
        new = yield from new_lights(task, turning, lights, relighter)
    finally:
        if relighter is not None:
            relighter.close()
    methods = {method.name: method for method in map(method_from_text, names)}
    form, measured, why = yield from _fit_best(task, methods, ranked, trials, limits, new)
    spent = time.perf_counter() - began
    form.attributes = {
        "method": form.method,
        "of": task.subject.name,
        "settings": settings_of(form.model),
        "asked": asdict(settings),
        "why": why,
        "trials": [asdict(trial) for trial in trials],
        "seconds": round(spent, 3),
        "tolerance": limits.tolerance,
        **measured,
        "notes": [note for light in lights.values() for note in light.notes],
        "tolerance_met": met(limits, measured),
        "peak_bytes": peak_bytes(),
        "fingerprint": (yield from in_thread("store", task.subject.fingerprint)),
        "versions": {
            "prt_core": __version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
    }
    state = yield from in_thread("store", form.model.state)
    for _ in write_compressed(BakeStore(bake.path, "r+"), state, form.attributes):
        yield Progress("store", 0, 0)
    return form.attributes


def _task(bake, settings):
    """What is to be compressed: the pixels of the bake's image, or its points."""
    image = bake.scene.image
    expect(
        image is not None or settings.of != "image",
        "of: this bake holds no image; bake with --camera-pixels, --geometry-image or --atlas",
    )
    if image is None or settings.of == "points":
        return Task.of(bake.transport, bake.scene.points, settings.seed, bake.dense)
    subject = Subject.of_bake(bake, "image")
    if not subject.shows_gloss:
        return Task.of_image(bake.transport, image, settings.seed)
    seen = subject.reflections, FixedView(bake).weights()
    return Task.of_image(bake.transport, image, settings.seed, *seen)


def _fit_best(task, methods, ranked, trials, limits, lights):
    """The first of the ranked that all points can be fitted with, within the limits.

    What fails is added to `trials`.

    Returns
    -------
    form : CompressedForm
    measured : dict
        See `measure_steps`.
    why : str
    """
    failed, beyond = set(), []
    for chosen, why in ranked:
        if (chosen.method, chosen.budget) in failed:
            continue
        try:
            method = methods[chosen.method]
            form, measured, trial = yield from _fit(task, method, chosen, limits, lights, failed)
        except FAILURES as error:
            reason = f"of all points: {reason_of(error)}"
            trials.append(Trial(chosen.method, chosen.settings, chosen.budget, failure=reason))
            continue
        if limits.excess(trial) > 1:
            beyond.append(trial)
            continue
        other = "" if trial.budget == chosen.budget else f"; of all points {trial.settings}"
        return form, measured, why + other
    raise PRTError(limits.beyond(beyond) if beyond else none_left(trials))


def _fit(task, method, chosen, limits, lights, failed):
    """Fit the chosen budget to all points; one a few up or down where the sample was wrong.

    Returns
    -------
    form : CompressedForm
    measured : dict
        See `measure_steps`.
    trial : Trial
        Measured on all points.
    """
    budgets, budget, way, best = method.budgets(task), chosen.budget, 0, None
    for _ in range(1 + _TURNS):
        model = budgets[budget]
        try:
            failed.add((chosen.method, budget))
            yield from model.fit_steps(task.rows)
            if method.finish is not None:
                yield from in_thread("seams", method.finish, model, task)
            form = CompressedForm(chosen.method, model)
            measured = yield from measure_steps(task, form, lights)
            trial = _measured(form, measured, budget)
        except FAILURES:
            # A budget beside the chosen one is tried for being better only.
            if best is None:
                raise
            break
        if best is None or _better(trial, best[2], limits):
            best = form, measured, trial
        step = -1 if limits.excess(trial) > 1 else 1 if met(limits, measured) is False else 0
        if not step or way == -step or not 0 <= budget + step < len(budgets):
            break
        way, budget = step, budget + step
    return best


def _better(trial, other, limits):
    """First within size and time, then within the tolerance, then nearer."""

    def key(t):
        return max(limits.excess(t), 1.0), t.error

    return key(trial) < key(other)


def _measured(form, measured, budget):
    figures = (
        measured["error"],
        measured["worst"],
        measured["bytes"] / 1e6,
        measured["milliseconds"],
    )
    return Trial(form.method, describe(form.model), budget, *figures, 0.0)


def _turning(lights, cube_map):
    return {name: TurningLight(light, cube_map) for name, light in lights.items()}
