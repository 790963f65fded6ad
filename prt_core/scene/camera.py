"""A camera: the directions through its pixels, and one that sees all of a scene."""

import warnings
from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_kind,
    expect_number,
    expect_offers,
    expect_whole,
)
from prt_core.runtime.machine import expect_memory


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera of perspective, without lens: it looks along its -z, with +y up.

    Parameters
    ----------
    matrix : (4, 4) float64
        Camera to world.
    tangent : float
        Of half the wider angle.

    Raises
    ------
    PRTError
        The matrix has an axis without length, or the tangent is not above zero.
    """

    matrix: np.ndarray
    tangent: float

    def __post_init__(self):
        matrix = expect_array("camera: matrix", self.matrix, (4, 4), np.float64)
        expect(
            matrix[:3, :3].any(axis=0).all(),
            "camera: expected a matrix whose axes have a length; a scale of 0 has none",
        )
        object.__setattr__(self, "matrix", matrix)
        tangent = expect_number("camera: tangent", self.tangent, above=0)
        object.__setattr__(self, "tangent", tangent)

    def __eq__(self, other):
        return isinstance(other, Camera) and self.to_dict() == other.to_dict()

    __hash__ = None

    @property
    def position(self):
        """(3,) float64: in the world."""
        return self.matrix[:3, 3]

    @property
    def axes(self):
        """(3, 3) float64: unit vectors to the right, up and back, as columns."""
        return self.matrix[:3, :3] / np.linalg.norm(self.matrix[:3, :3], axis=0)

    def to_dict(self):
        """As numbers and lists, which a store keeps; `Camera(**values)` makes it again."""
        return {"matrix": self.matrix.tolist(), "tangent": self.tangent}


def camera_rays(camera, width, height, samples):
    """Directions through the pixels of a view.

    Parameters
    ----------
    camera : Camera
    width, height : int
    samples : int
        Along each side of a pixel.

    Returns
    -------
    (height * samples * width * samples, 3) float64
        Unit vectors in world axes, in reading order of the samples.
    """
    camera = expect_camera(camera)
    width, height = (expect_whole("image", side, 1) for side in (width, height))
    samples = expect_whole("samples", samples, 1)
    # Twelve numbers of float64 for each ray while they are made.
    expect_memory(
        f"image: {width} x {height} pixels", 100.0 * width * height * samples**2, "take fewer"
    )
    step = 2 * camera.tangent / max(width, height)
    x = (np.arange(width * samples) + 0.5) / samples - width / 2
    y = height / 2 - (np.arange(height * samples) + 0.5) / samples
    x, y = np.meshgrid(x * step, y * step)
    local = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3)
    directions = local @ camera.axes.T
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def auto_camera(scene):
    """A `Camera` that sees the whole of a `scene` from the front, a little from above."""
    expect_offers("scene", scene, ("centre", "size"), "a Scene")
    away = np.array([0.35, -0.85, 0.45])
    away /= np.linalg.norm(away)
    right = np.cross([0, 0, 1.0], away)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([right, np.cross(away, right), away])
    matrix[:3, 3] = scene.centre + away * scene.size * 1.6
    return Camera(matrix, 0.42)


def expect_camera(camera):
    """`camera`, where it is a `Camera`; a dict with its matrix and tangent for one release."""
    if isinstance(camera, dict) and set(camera) == {"matrix", "tangent"}:
        warnings.warn(
            "camera: a dict is a Camera(matrix, tangent) now", DeprecationWarning, stacklevel=3
        )
        return Camera(**camera)
    return expect_kind("camera", camera, Camera)
