"""Fit what the web page shows colours by to Blender's AgX, and print it as JavaScript.

    python scripts/fit_view_transform.py

The page's is a mixture of channels, a curve of each channel's logarithm, and a mixture again. What
it is fitted to is what Blender saves of colours under AgX.
"""

import tempfile
from pathlib import Path

import bpy
import numpy as np
from scipy.optimize import least_squares

_SIDE, _NODES = 32, 31
# Stops of the curve's first and last node.
_FIRST, _LAST = -12.0, 6.0


def colours(seed):
    """(n, 3) linear colours: greys and colours as surfaces have them, and a few saturated ones."""
    rng = np.random.default_rng(seed)
    n = _SIDE * _SIDE
    stops = rng.uniform(-9, 5, (n, 1))
    spread = rng.choice([0, 0.5, 1.5, 3], (n, 1))
    return (2.0 ** (stops + spread * rng.normal(size=(n, 3)))).astype(np.float32)


def as_blender_shows(linear):
    """(n, 3) in 0..1: what is saved under AgX."""
    scene = bpy.context.scene
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "None"
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.color_depth = "16"
    scene.render.dither_intensity = 0
    image = bpy.data.images.new("colours", _SIDE, _SIDE, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    pixels = np.ones((_SIDE * _SIDE, 4), np.float32)
    pixels[:, :3] = linear
    image.pixels.foreach_set(pixels.ravel())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "colours.png"
        image.save_render(str(path), scene=scene)
        saved = bpy.data.images.load(str(path))
        saved.colorspace_settings.name = "Non-Color"
        values = np.empty(_SIDE * _SIDE * 4, np.float32)
        saved.pixels.foreach_get(values)
    return values.reshape(-1, 4)[:, :3].astype(np.float64)


def shown(parameters, linear):
    """The page's colours."""
    inset, outset = (with_rows_of_one(parameters[k : k + 6]) for k in (0, 6))
    place = np.clip(
        (np.log2(np.maximum(linear @ inset.T, 1e-10)) - _FIRST) / (_LAST - _FIRST), 0, 1
    )
    curve = np.interp(place * (_NODES - 1), np.arange(_NODES), parameters[12:])
    return np.clip(curve @ outset.T, 0, 1)


def with_rows_of_one(six):
    """(3, 3) matrix that leaves greys as they are."""
    a, b, c, d, e, f = six
    return np.array([[1 - a - b, a, b], [c, 1 - c - d, d], [e, f, 1 - e - f]])


def main():
    linear, other = colours(1), colours(2)
    truth, check = as_blender_shows(linear), as_blender_shows(other)
    curve = np.clip((np.arange(_NODES) / (_NODES - 1) - 0.1) * 1.25, 0, 1)
    start = np.concatenate([[0.1] * 6, [-0.1] * 6, curve])
    fit = least_squares(
        lambda p: np.concatenate([(shown(p, linear) - truth).ravel(), 0.02 * np.diff(p[12:], 2)]),
        start,
        max_nfev=60,
    )
    error = np.abs(shown(fit.x, other) - check)
    print(f"// of new colours: mean {error.mean():.4f}, 99 % below {np.quantile(error, 0.99):.4f}")
    for name, k in (("inset", 0), ("outset", 6)):
        # Column after column, as shaders take matrices.
        values = with_rows_of_one(fit.x[k : k + 6]).T.ravel()
        print(f"  {name}: [{', '.join(f'{v:.3f}' for v in values)}],")
    print(f"  curve: [{', '.join(f'{v:.3f}' for v in fit.x[12:])}],")


if __name__ == "__main__":
    main()
