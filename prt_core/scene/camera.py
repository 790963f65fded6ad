"""A camera: the directions through its pixels, and one that sees all of a scene."""

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_number,
    expect_offers,
    expect_whole,
    shown,
)
from prt_core.runtime.machine import expect_memory


def camera_rays(camera, width, height, samples):
    """Directions through the pixels of a view.

    Parameters
    ----------
    camera : dict
        `matrix` (4 x 4, camera to world) and `tangent` of half the wider angle.
    width, height : int
    samples : int
        Along each side of a pixel.

    Returns
    -------
    (height * samples * width * samples, 3) float64
        Unit vectors in world axes, in reading order of the samples.
    """
    expect_camera(camera)
    width, height = (expect_whole("image", side, 1) for side in (width, height))
    samples = expect_whole("samples", samples, 1)
    # Twelve numbers of float64 for each ray while they are made.
    expect_memory(
        f"image: {width} x {height} pixels", 100.0 * width * height * samples**2, "take fewer"
    )
    step = 2 * camera["tangent"] / max(width, height)
    x = (np.arange(width * samples) + 0.5) / samples - width / 2
    y = height / 2 - (np.arange(height * samples) + 0.5) / samples
    x, y = np.meshgrid(x * step, y * step)
    local = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3)
    matrix = np.asarray(camera["matrix"], np.float64)
    directions = local @ (matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)).T
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def auto_camera(scene, width=960, height=540):
    """A camera that sees the whole scene from the front, a little from above.

    Parameters
    ----------
    scene : Scene
    width, height : int
        Of the picture.

    Returns
    -------
    dict
        `matrix` (4 x 4, camera to world), `tangent` of half the wider angle.
    """
    expect_offers("scene", scene, ("centre", "size"), "a Scene")
    away = np.array([0.35, -0.85, 0.45])
    away /= np.linalg.norm(away)
    right = np.cross([0, 0, 1.0], away)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([right, np.cross(away, right), away])
    matrix[:3, 3] = scene.centre + away * scene.size * 1.6
    return {"matrix": matrix.tolist(), "tangent": 0.42}


def expect_camera(camera):
    """Raise `PRTError` unless this is a camera (see `camera_rays`)."""
    good = isinstance(camera, dict) and {"matrix", "tangent"} <= set(camera)
    expect(good, f"camera: expected a dict with a matrix and a tangent, got {shown(camera)}")
    matrix = expect_array("camera: matrix", camera["matrix"], (4, 4), np.float64)
    expect(
        matrix[:3, :3].any(axis=0).all(),
        "camera: expected a matrix whose axes have a length; a scale of 0 has none",
    )
    expect_number("camera: tangent", camera["tangent"], above=0)
