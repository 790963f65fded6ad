"""The compressed form of a bake: chosen, made, measured under lights new to it, kept, loaded."""

import platform
import time
from dataclasses import asdict, dataclass, field

import numpy as np

from prt_core.compress import (
    Limits,
    Task,
    border_pairs,
    candidate_names,
    choose_steps,
    method_asked,
    method_named,
    method_names,
    neighbour_pairs,
    seam,
)
from prt_core.compress.choice.choose import (
    FAILURES,
    WORST,
    Trial,
    none_left,
    reason_of,
    relative_l2,
)
from prt_core.compress.choice.methods import describe, settings_of
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
from prt_core.runtime.machine import peak_bytes
from prt_core.runtime.progress import Progress, beside
from prt_core.store import (
    AGAIN,
    BakeStore,
    compressed_facts,
    damage_said,
    read_compressed,
    write_compressed,
)
from prt_core.version import __version__

# Degrees about z: of the lights a method is chosen under, and of those it is measured under.
_CHOICE, _MEASURE = 20.0, (65.0, 185.0, 305.0)
_CHOICE_LIGHTS, _TURNS = 8, 2


@dataclass(frozen=True)
class CompressSettings:
    """What a compressed form is to be.

    Parameters
    ----------
    method : str
        `auto`, or a registered method (`compress.method_names()`); settings of its own that are
        to be the same all along its ladder as NAME:key=value,key=value.
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
        expect(
            good and (self.method == "auto" or name in names),
            f"method: expected auto, {', '.join(names)} or none, got {shown(self.method)}",
        )
        if name != "auto":
            method_asked(self.method)
        expect_seed(self.seed)
        self.limits  # noqa: B018  (checks them)

    @property
    def limits(self):
        """The `Limits` that were asked for."""
        asked = self.tolerance, self.megabytes, self.milliseconds
        return Limits(0.01) if asked == (None, None, None) else Limits(*asked)


@dataclass
class Compressed:
    """A compressed form in memory.

    Attributes
    ----------
    method : str
    model : Compressor
        Fitted.
    facts : dict
        Settings, size, error and time (see `compress_steps`).
    """

    method: str
    model: object
    facts: dict = field(default_factory=dict)

    @property
    def of(self):
        """What it holds: "points" or "image"."""
        return self.facts.get("of", "points")

    def relighter(self, transport):
        """What relights it: `relight(light)` gives radiance, all bounces included.

        Parameters
        ----------
        transport : Transport or None
            Of the bake; None for pixels, which have no bits to be looked up.
        """
        return method_named(self.method).relighter(self.model, transport)


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
        The facts that are stored: method, of ("points" or "image"), settings, why, trials, bytes,
        bits_a_coefficient, seconds, milliseconds, milliseconds_worst, error, worst, worst_light,
        lights, tolerance, tolerance_met, matrix_l2, seam, peak_bytes, fingerprint, versions.
    """
    settings = CompressSettings() if settings is None else settings
    expect_kind("settings", settings, CompressSettings)
    expect_offers("bake", bake, ("scene", "transport", "path"), "what `load` returns")
    lights = _expect_lights(lights)
    with system_errors(bake.path):
        return (yield from _compress(bake, settings, lights))


def _expect_lights(lights):
    """Environments by name; the standing ones where none are given."""
    if lights is None:
        return standing_lights()
    expect_named("lights", lights, EnvironmentMap, "environments")
    expect(lights, "lights: expected at least one")
    return lights


def _compress(bake, settings, lights):
    expect(bake.path is not None, "bake: is not on disk; load it from its folder NAME.prt")
    began = time.perf_counter()
    task = _task(bake, settings)
    names = candidate_names() if settings.method == "auto" else [settings.method]
    if task.dense is not None and settings.method == "auto":
        # Clusters of the points that are known best, and the others after them.
        names = ["sparse_cpca" if name == "cpca" else name for name in names]
    turning = yield from beside("lights", _turning, lights, bake.cube_map)
    few = list(turning.items())[:: max(1, len(turning) // _CHOICE_LIGHTS)]
    few = {name: light.at(_CHOICE) for name, light in few}
    limits = settings.limits
    ranked, trials = yield from choose_steps(task, names, limits, few)
    new = yield from _new_lights(task, turning, lights)
    methods = {method.name: method for method in map(method_asked, names)}
    made, found, why = yield from _fit_best(task, methods, ranked, trials, limits, new)
    spent = time.perf_counter() - began
    made.facts = {
        "method": made.method,
        "of": "points" if task.image is None else "image",
        "settings": settings_of(made.model),
        "asked": asdict(settings),
        "why": why,
        "trials": [asdict(trial) for trial in trials],
        "seconds": round(spent, 3),
        "tolerance": limits.tolerance,
        **found,
        "notes": [note for light in lights.values() for note in light.notes],
        "tolerance_met": met(limits, found),
        "peak_bytes": peak_bytes(),
        "fingerprint": (yield from beside("store", fingerprint_of, bake, task.image)),
        "versions": {
            "prt_core": __version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
    }
    state = yield from beside("store", made.model.state)
    for _ in write_compressed(BakeStore(bake.path, "r+"), state, made.facts):
        yield Progress("store", 0, 0)
    return made.facts


def _task(bake, settings):
    """What is to be compressed: the pixels of the bake's image, or its points."""
    image = bake.scene.image
    expect(
        image is not None or settings.of != "image",
        "of: this bake holds no image; bake with --camera-pixels or --geometry-image",
    )
    if image is None or settings.of == "points":
        return Task.of(bake.transport, bake.scene.points, settings.seed, bake.dense)
    return Task.of_image(bake.transport, image, settings.seed)


def fingerprint_of(bake, image):
    """A digest of all that the colours depend on: of a bake's points, or of its `image`."""
    digest = bake.transport.fingerprint()
    return digest if image is None else f"{digest} {image.digest()}"


def met(limits, found):
    """Whether what was measured keeps what was asked for; None where no tolerance was."""
    if limits.tolerance is None:
        return None
    most = WORST * limits.tolerance
    return bool(found["error"] <= limits.tolerance and found["worst"] <= most)


def _fit_best(task, methods, ranked, trials, limits, lights):
    """The first of the ranked that all points can be fitted with, within the limits.

    What fails is added to `trials`.

    Returns
    -------
    made : Compressed
    found : dict
        See `measure_steps`.
    why : str
    """
    failed, beyond = set(), []
    for chosen, why in ranked:
        if (chosen.method, chosen.rung) in failed:
            continue
        try:
            method = methods[chosen.method]
            made, found, trial = yield from _fit(task, method, chosen, limits, lights, failed)
        except FAILURES as error:
            reason = f"of all points: {reason_of(error)}"
            trials.append(Trial(chosen.method, chosen.settings, chosen.rung, failure=reason))
            continue
        if limits.excess(trial) > 1:
            beyond.append(trial)
            continue
        other = "" if trial.rung == chosen.rung else f"; of all points {trial.settings}"
        return made, found, why + other
    raise PRTError(limits.beyond(beyond) if beyond else none_left(trials))


def _fit(task, method, chosen, limits, lights, failed):
    """Fit the chosen rung to all points; a few rungs up or down where the sample was wrong.

    Returns
    -------
    made : Compressed
    found : dict
        See `measure_steps`.
    trial : Trial
        Measured on all points.
    """
    ladder, rung, way, best = method.ladder(task), chosen.rung, 0, None
    for _ in range(1 + _TURNS):
        model = ladder[rung]
        try:
            failed.add((chosen.method, rung))
            yield from model.fit_steps(task.rows)
            if method.finish is not None:
                yield from beside("seams", method.finish, model, task)
            made = Compressed(chosen.method, model)
            found = yield from measure_steps(task, made, lights)
            trial = _measured(made, found, rung)
        except FAILURES:
            # A rung beside the chosen one is tried for being better only.
            if best is None:
                raise
            break
        if best is None or _better(trial, best[2], limits):
            best = made, found, trial
        step = -1 if limits.excess(trial) > 1 else 1 if met(limits, found) is False else 0
        if not step or way == -step or not 0 <= rung + step < len(ladder):
            break
        way, rung = step, rung + step
    return best


def _better(trial, other, limits):
    """First within size and time, then within the tolerance, then nearer."""

    def key(t):
        return max(limits.excess(t), 1.0), t.error

    return key(trial) < key(other)


def _measured(made, found, rung):
    figures = found["error"], found["worst"], found["bytes"] / 1e6, found["milliseconds"]
    return Trial(made.method, describe(made.model), rung, *figures, 0.0)


def _new_lights(task, turning, lights):
    """Lights to measure under: {what it is called: (light on texels, exact colours)}."""
    found = {}
    for name, image in lights.items():
        for turn in _MEASURE:
            # The exact side takes the environment the exact way, so turning is measured as well.
            cube_map = task.transport.cube_map
            light = yield from beside("lights", image.to_cube_map, cube_map, turn)
            found[f"{name} at {turn:g}°"] = light
    colours = yield from beside("measure", task.colours, found)
    quick = {f"{n} at {t:g}°": (turning[n], t) for n in lights for t in _MEASURE}
    return {name: (*quick[name], colours[name]) for name in found}


def measure_steps(task, made, lights):
    """Errors and times of a compressed form under turned lights; a generator of `Progress`.

    Parameters
    ----------
    task : Task
    made : Compressed
    lights : dict of str -> (TurningLight, float, (n_points, 3) float32)
        Each with its rotation, in degrees about z, and the exact colours.

    Returns
    -------
    dict
        bytes, bits_a_coefficient, milliseconds (median), milliseconds_worst, error (mean), worst,
        worst_light, lights (how many), matrix_l2 (None where the method does not know), seam.
    """
    transport = task.transport
    quick = yield from beside("measure", made.relighter, task.read_bits)
    labels = getattr(made.model, "labels_", None)
    border = None
    if labels is not None:
        pairs = neighbour_pairs(task.positions, task.normals, task.groups)
        border = border_pairs(labels, pairs)
    errors, spent, seams = {}, [], [0.0]

    def one(name, turning, turn, truth):
        light = turning.at(turn)
        start = time.perf_counter()
        found = quick.relight(light)
        spent.append(time.perf_counter() - start)
        errors[name] = relative_l2(found, truth)
        if border is not None:
            seams.append(seam(found, truth, border)["largest"])

    for name, light in lights.items():
        yield from beside("measure", one, name, *light)
        yield Progress("measure", len(errors), len(lights))
    bad = [name for name, error in errors.items() if not np.isfinite(error)]
    expect(
        not bad,
        f"method: the colours of {made.method} are not finite under {', '.join(bad)}; leave such "
        "lights out, or choose another method. Nothing was stored",
    )
    worst = max(errors, key=errors.get)
    model = made.model
    return {
        "bytes": int(model.nbytes),
        "bits_a_coefficient": 8 * model.nbytes / (3 * task.n_points * transport.n_directions),
        "milliseconds": 1e3 * float(np.median(spent)),
        "milliseconds_worst": 1e3 * max(spent),
        "error": float(np.mean(list(errors.values()))),
        "worst": errors[worst],
        "worst_light": worst,
        "lights": len(lights),
        "matrix_l2": getattr(model, "matrix_error_", None),
        "seam": max(seams),
    }


def load_compressed(bake):
    """The compressed form of a bake, or why there is none to use.

    Returns
    -------
    Compressed or None, str
        None where there is none or it is of another bake: the string says so.

    Raises
    ------
    PRTError
        It is damaged.
    """
    if bake.path is None:
        return None, "the bake is not on disk"
    with system_errors(bake.path):
        return _load(bake)


def _load(bake):
    store = BakeStore(bake.path)
    facts = compressed_facts(store)
    if facts is None:
        return None, "there is no compressed form; make one with 'prt compress'"
    if facts.get("method") not in method_names():
        return None, f"its method {facts.get('method')!r:.40} is not known here; {AGAIN}"
    image = bake.scene.image if facts.get("of") == "image" else None
    if facts.get("fingerprint") != fingerprint_of(bake, image):
        return None, f"the compressed form is of another state of the bake; {AGAIN}"
    state = read_compressed(store, facts)
    n_points, n_directions = bake.transport.shape
    n_points = n_points if image is None else image.height * image.width
    expect(
        (state.get("n_points"), state.get("n_directions")) == (n_points, n_directions),
        f"{bake.path}: its compressed form has another number of points or directions; {AGAIN}",
    )
    with damage_said(bake.path, "its compressed form", AGAIN):
        model = method_named(facts["method"]).kind.from_state(state)
    return Compressed(facts["method"], model, facts), ""


def standing_lights():
    """Skies for where no images are at hand: even, with a soft sun, and with a hard one."""
    height = 64
    z = np.sin(np.pi / 2 - (np.arange(height) + 0.5) / height * np.pi)[:, None]
    angle = np.pi - (np.arange(2 * height) + 0.5) / height * np.pi
    radius = np.sqrt(1 - z * z)
    ways = np.stack([radius * np.cos(angle), radius * np.sin(angle), z + 0 * angle], axis=-1)
    sky = (0.6 + 0.4 * z + 0 * angle)[..., None] * np.array([0.6, 0.8, 1.0])
    lights = {"even sky": sky}
    for name, toward, sharpness, power in (
        ("low soft sun", (0.8, 0.3, 0.52), 40, 8),
        ("high hard sun", (-0.3, -0.4, 0.87), 2000, 400),
    ):
        lobe = np.exp(sharpness * (ways @ toward / np.linalg.norm(toward) - 1))
        lights[name] = 0.5 * sky + power * lobe[..., None] * np.array([1.0, 0.9, 0.7])
    return {name: EnvironmentMap(p.astype(np.float32), name) for name, p in lights.items()}


def _turning(lights, cube_map):
    return {name: TurningLight(light, cube_map) for name, light in lights.items()}
