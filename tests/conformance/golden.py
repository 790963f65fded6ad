"""Golden files: what Cycles bakes of a scene, and how far off it is without its feature.

A file `NAME.npz` holds (n_corners, 3) float16 for each target, `blender` (the version that made
it), `noise` (relative, of the mean of the two bakes that it is) and `without` (the relative
difference of the scene without its feature).
"""

from pathlib import Path

import bpy
import numpy as np

from tests.benchmarks import cycles_truth

FOLDER = Path(__file__).parent / "golden"
# Corners that may be off: those at rims and in corners, where a colour depends on the last digit.
WORST = 0.05
# Mean radiance below which there is nothing to be relative to.
DARK = 1e-3
KEYS = ("blender", "noise", "without")


def read_golden(name):
    """(colours of each target as float32, the other values) of a scene."""
    with np.load(FOLDER / f"{name}.npz") as file:
        values = dict(file)
    other = {key: values.pop(key)[()] for key in KEYS}
    return {target: colours.astype(np.float32) for target, colours in values.items()}, other


def make_golden(scene, folder):
    """Bake a scene with Cycles and write its golden file.

    Returns
    -------
    dict
        `noise` and `without` (see above).

    Raises
    ------
    ValueError
        The bake is too noisy for the bound, or the feature changes too little to be tested.
    """
    truth, other = truth_of(scene, folder)
    noise, without = other["noise"], other["without"]
    if noise > scene.bound / 2:
        raise ValueError(f"Cycles' noise is {noise:.2%}, the bound {scene.bound:.1%}: more samples")
    if without < 2 * scene.bound:
        raise ValueError(f"without its feature it is only {without:.2%} off: it would not be seen")
    values = {name: colours.astype(np.float16) for name, colours in truth.items()}
    np.savez_compressed(FOLDER / f"{scene.name}.npz", **values, **other)
    return {"noise": noise, "without": without}


def truth_of(scene, folder):
    """What `read_golden` gives, of a scene as the Cycles at hand bakes it."""
    halves = [cycles_colours(scene, folder, scene.samples // 2, seed) for seed in (0, 1)]
    truth = {name: (halves[0][name] + halves[1][name]) / 2 for name in scene.targets}
    plain = cycles_colours(scene, folder, max(scene.samples // 4, 16), 0, with_feature=False)
    return truth, {
        "blender": bpy.app.version_string,
        "noise": max(error(halves[0][name], truth[name]) for name in scene.targets),
        "without": max(error(plain[name], truth[name]) for name in scene.targets),
    }


def cycles_colours(scene, folder, samples, seed, with_feature=True):
    """(n_corners, 3) float32 of each target: Cycles' diffuse pass of all light that reaches it."""
    save(scene, folder / "scene.blend", with_feature)
    bpy.ops.wm.open_mainfile(filepath=str(folder / "scene.blend"))
    opened = bpy.context.scene
    cycles_truth.set_cycles(opened, samples, seed)
    opened.cycles.transparent_max_bounces = opened.cycles.max_bounces
    return cycles_truth.bake(opened, scene.targets, "all", "CORNER")[0]


def save(scene, path, with_feature=True):
    """Build a scene and save it as a .blend, as people have it."""
    scene.open(with_feature)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def error(colours, truth):
    """Relative L2 distance without the worst corners; of a dark truth, the largest value."""
    finite = np.isfinite(truth).all(axis=1)
    colours, truth = colours[finite].astype(float), truth[finite].astype(float)
    if truth.mean() < DARK:
        return float(np.abs(colours).max())
    square = np.sort(((colours - truth) ** 2).sum(axis=1))
    kept = square[: max(1, int(len(square) * (1 - WORST)))]
    return float(np.sqrt(kept.sum() / (truth**2).sum()))
