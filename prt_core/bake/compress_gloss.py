"""The compressed form of a bake's gloss: what views show of it under light that turns.

The field of incoming light is filled in anew for each light. Transfer matrices are not: a light is
a few products, and a view a few more. They hold wide lobes alone, and how near they are is measured
under lights and views that they were not made for.
"""

import platform
import time
from dataclasses import asdict

import numpy as np

from prt_core.compress.choice.choose import WORST, relative_l2
from prt_core.compress.gloss_transfer import GlossTransfer
from prt_core.errors import PRTError, expect, shown
from prt_core.relight.gloss_form import GlossForm, gloss_fingerprint
from prt_core.relight.lighting import Lighting
from prt_core.relight.relighter import Relighter
from prt_core.runtime.machine import peak_bytes
from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.progress import Progress
from prt_core.scene import auto_camera
from prt_core.store import GLOSS_FORM, BakeStore, write_compressed
from prt_core.transport import View
from prt_core.version import __version__

GLOSS_METHODS = ("transfer",)
# Why others are measured by the bench and not stored.
_OF_BENCH = {
    "terms": "a light takes as long as the field that it would spare",
    "triple": "it takes lobes of one material, and more memory than the field",
    "maps": "it knows of no shadow",
    "samples": "it needs the bake's own bits and is further off than the field",
}
# Below this roughness harmonics say nothing of a lobe; `auto` does not try them.
WIDE = 0.45
# Degrees about z of the lights, and of the views; the least seconds of a repeated view.
_ROTATIONS, _VIEWS = (65.0, 185.0, 305.0), (40.0, 200.0)


def expect_gloss_method(name):
    """Raise `PRTError` for forms of gloss that have no door."""
    if name in _OF_BENCH:
        raise PRTError(
            f"method: '{name}' is of views and is not stored, for {_OF_BENCH[name]}; compare it "
            f"with 'prt bench gloss', store {', '.join(GLOSS_METHODS)}"
        )


def widest_needed(bake):
    """The least roughness of the glossy points of a bake: slider of the lobes that they have."""
    points = np.concatenate([part.points for part in bake.reflections])
    materials = bake.scene.points.materials[points]
    facets = (materials.glossy.max(axis=1) > 0) | (materials.metal.max(axis=1) > 0)
    facets |= (materials.dielectric[:, 0] > 0) & (materials.ior[:, 0] != 1)
    least = np.where(facets, materials.roughness[:, 0], 1.0)
    coat = materials.coat[:, 0] > 0
    return float(np.minimum(least, np.where(coat, materials.coat_roughness[:, 0], 1.0)).min())


def compress_gloss_steps(bake, settings, lights, only_within=False):
    """Compress what views show of a bake, and store that; a generator of `Progress`.

    Parameters
    ----------
    bake : Bake
        With gloss, as `load` gives it.
    settings : CompressSettings
        With one of `GLOSS_METHODS`.
    lights : dict of str -> EnvironmentMap
        Under which it is measured.
    only_within : bool
        Store it only where it keeps what was asked for.

    Returns
    -------
    dict
        As `compress_steps` returns it, with `of` "gloss", `views`, `view_milliseconds`; `stored`.
    """
    expect(
        bake.reflections,
        f"method: {shown(settings.method)} is of gloss, and this bake knows of none; bake with "
        "--gloss, and with materials that have some",
    )
    began, limits = time.perf_counter(), settings.limits
    model = GlossTransfer.from_text(settings.method, settings.seed)
    yield from model.fit_steps(bake.transport, bake.reflections)
    form = yield from in_thread("gloss", GlossForm, bake, model)
    measured = yield from _measured(bake, form, lights)
    within = measured["bytes"] <= 1e6 * (limits.megabytes or np.inf)
    within &= measured["milliseconds"] <= (limits.milliseconds or np.inf)
    met = None
    if limits.tolerance is not None:
        most = limits.tolerance
        met = bool(measured["error"] <= most and measured["worst"] <= WORST * most)
    report = {
        "method": model.name,
        "of": "gloss",
        "settings": model.settings(),
        "asked": asdict(settings),
        "why": "all that was asked for",
        "trials": [],
        "seconds": round(time.perf_counter() - began, 3),
        "tolerance": limits.tolerance,
        **measured,
        "least_roughness": widest_needed(bake),
        "tolerance_met": met,
        "peak_bytes": peak_bytes(),
        "fingerprint": (yield from in_thread("store", gloss_fingerprint, bake)),
        "versions": {
            "prt_core": __version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
    }
    if only_within and not (within and met is not False):
        return {**report, "stored": False}
    expect(
        within,
        f"megabytes, milliseconds: cannot be kept; {model.name} takes "
        f"{measured['bytes'] / 1e6:.3g} MB and {measured['milliseconds']:.3g} ms a light. Nothing "
        "was stored",
    )
    state = model.state()
    for _ in write_compressed(BakeStore(bake.path, "r+"), state, report, GLOSS_FORM):
        yield Progress("store", 0, 0)
    return {**report, "stored": True}


def _views(bake):
    """Views by name: from the camera, and from other sides."""
    own = bake.camera or auto_camera(bake.scene)
    views = {"the camera": View.of_camera(own)}
    away = own.position - bake.scene.centre
    for turn in _VIEWS:
        angle = np.radians(turn)
        c, s = np.cos(angle), np.sin(angle)
        turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ away
        views[f"{turn:g}° around"] = View(bake.scene.centre + turned)
    return views


def _measured(bake, form, lights):
    """Errors against exact relighting, and times; a generator of `Progress`."""
    transport, errors, spent, viewed = bake.transport, {}, [], []
    relighter, views = Relighter(bake, form="exact"), list(_views(bake).items())
    try:
        for index, (name, image) in enumerate(lights.items()):
            turn = _ROTATIONS[index % len(_ROTATIONS)]
            seen, view = views[index % len(views)]
            lighting = Lighting(image, rotation=turn, emission="none")
            truth = yield from relighter.steps(lighting, view=view)
            texels = image.to_cube_map(transport.cube_map, turn)
            start = time.perf_counter()
            yield from in_thread("measure", form.light, texels)
            spent.append(time.perf_counter() - start)
            received = yield from in_thread("measure", transport.product, texels)
            sent = transport.exit_radiance(received).toward()
            even = sent - transport.materials.stand_in * received
            start = time.perf_counter()
            reflected, share = yield from form.toward_steps(view)
            viewed.append(time.perf_counter() - start)
            errors[f"{name} at {turn:g}° from {seen}"] = relative_l2(
                even * share + reflected, truth
            )
            yield Progress("measure", index + 1, len(lights))
    finally:
        relighter.close()
    worst = max(errors, key=errors.get)
    n_bytes = int(form.model.nbytes)
    n_numbers = len(form.points) * form.model.order**4 * 3
    return {
        "bytes": n_bytes,
        "bits_a_coefficient": 8 * n_bytes / n_numbers,
        "milliseconds": 1e3 * float(np.median(spent)),
        "milliseconds_worst": 1e3 * max(spent),
        "view_milliseconds": 1e3 * float(np.median(viewed)),
        "error": float(np.mean(list(errors.values()))),
        "worst": errors[worst],
        "worst_light": worst,
        "lights": len(lights),
        "views": len(views),
    }
