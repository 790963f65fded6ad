"""How near a compressed form is, how large and how quick, under lights that are new to it."""

import time

import numpy as np

from prt_core.compress import border_pairs, neighbour_pairs, seam
from prt_core.compress.choice.choose import WORST, radiance_of, relative_l2
from prt_core.errors import expect
from prt_core.light import EnvironmentMap
from prt_core.relight.lighting import Lighting
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import Progress

# Degrees about z, other than those of the lights that a method is chosen under.
_ROTATIONS = 65.0, 185.0, 305.0


def new_lights(task, turning, lights, relighter=None):
    """Lights that no method was chosen under, and the exact colours; a generator of `Progress`.

    Parameters
    ----------
    task : Task
    turning : dict of str -> TurningLight
    lights : dict of str -> EnvironmentMap
    relighter : Relighter, optional
        That relights exactly: where pixels show gloss, which takes long enough for each light to
        be turned but once.

    Returns
    -------
    dict of str -> (TurningLight, float, (n_points, 3) float32)
        See `measure_steps`.
    """
    if relighter is not None:
        result = {}
        for index, (name, image) in enumerate(lights.items()):
            turn = _ROTATIONS[index % len(_ROTATIONS)]
            steps = relighter.steps(Lighting(image, rotation=turn, emission="none"), of="image")
            pixels = yield from steps
            result[f"{name} at {turn:g}°"] = turning[name], turn, pixels.reshape(-1, 3)
            yield Progress("measure", index + 1, len(lights))
        return result
    lights_at = {}
    for name, image in lights.items():
        for turn in _ROTATIONS:
            # The exact side takes the environment the exact way, so turning is measured as well.
            cube_map = task.transport.cube_map
            light = yield from in_thread("lights", image.to_cube_map, cube_map, turn)
            lights_at[f"{name} at {turn:g}°"] = light
    colours = yield from in_thread("measure", task.colours, lights_at)
    turned = {f"{n} at {t:g}°": (turning[n], t) for n in lights for t in _ROTATIONS}
    return {name: (*turned[name], colours[name]) for name in lights_at}


def measure_steps(task, form, lights):
    """Errors and times of a compressed form under turned lights; a generator of `Progress`.

    Parameters
    ----------
    task : Task
    form : CompressedForm
    lights : dict of str -> (TurningLight, float, (n_points, 3) float32)
        Each with its rotation, in degrees about z, and the exact colours.

    Returns
    -------
    dict
        bytes, bits_a_coefficient, milliseconds (median), milliseconds_worst, error (mean), worst,
        worst_light, lights (how many), matrix_l2 (None where the method does not know), seam; with
        gloss rows_error, which rows have that are not compressed.
    """
    subject, n_directions = task.subject, task.transport.n_directions
    evaluator = yield from in_thread("measure", form.evaluator, subject)
    labels = getattr(form.model, "labels_", None)
    border = None
    if labels is not None:
        pairs = neighbour_pairs(task.positions, task.normals, task.groups)
        border = border_pairs(labels, pairs)
    errors, spent, seams, of_rows = {}, [], [0.0], []

    def one(name, turning, turn, truth):
        light = turning.at(turn)
        start = time.perf_counter()
        radiance = radiance_of(evaluator, subject, light)
        spent.append(time.perf_counter() - start)
        errors[name] = relative_l2(radiance, truth)
        if subject.shows_gloss:
            of_rows.append(relative_l2(task.rows.product(light), truth))
        if border is not None:
            seams.append(seam(radiance, truth, border)["largest"])

    for name, light in lights.items():
        yield from in_thread("measure", one, name, *light)
        yield Progress("measure", len(errors), len(lights))
    bad = [name for name, error in errors.items() if not np.isfinite(error)]
    expect(
        not bad,
        f"method: the colours of {form.method} are not finite under {', '.join(bad)}; leave such "
        "lights out, or choose another method. Nothing was stored",
    )
    worst = max(errors, key=errors.get)
    model = form.model
    return {
        "bytes": int(model.nbytes),
        "bits_a_coefficient": 8 * model.nbytes / (3 * task.n_points * n_directions),
        "milliseconds": 1e3 * float(np.median(spent)),
        "milliseconds_worst": 1e3 * max(spent),
        "error": float(np.mean(list(errors.values()))),
        "worst": errors[worst],
        "worst_light": worst,
        "lights": len(lights),
        "matrix_l2": getattr(model, "matrix_error_", None),
        "seam": max(seams),
        **({"rows_error": float(np.mean(of_rows))} if of_rows else {}),
    }


def met(limits, measured):
    """Whether what was measured keeps what was asked for; None where no tolerance was."""
    if limits.tolerance is None:
        return None
    most = WORST * limits.tolerance
    return bool(measured["error"] <= limits.tolerance and measured["worst"] <= most)


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
