"""Hidden points inside triangles, where those around a hit do not tell what it looks like."""

import hashlib
from dataclasses import dataclass, replace

import numpy as np

from prt_core.scene.images.point_images import surface_points
from prt_core.scene.points import joined


@dataclass(frozen=True)
class Details:
    """Bake points that show a place inside a triangle.

    Attributes
    ----------
    point : (n,) int32
        Bake points; none is visible.
    triangle : (n,) int32
    barycentric : (n, 2) float32
        Weights of the second and third corner.
    back : (n,) bool
        Whether they lie on the back side.
    """

    point: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    back: np.ndarray

    def __len__(self):
        return len(self.point)

    def digest(self, lattice_back):
        """Hexadecimal digest of where they lie, and of which backs have points (see `Scene`)."""
        state = hashlib.blake2b(digest_size=16)
        if (lattice_back >= 0).any():
            state.update(np.ascontiguousarray(lattice_back))
        for array in (self.triangle, self.barycentric, self.back):
            state.update(np.ascontiguousarray(array))
        return state.hexdigest()


def no_details():
    """Those of a scene that has none."""
    none = np.zeros(0, np.int32)
    return Details(none, none, np.zeros((0, 2), np.float32), np.zeros(0, bool))


def with_details(scene, triangle, barycentric, back):
    """The scene with more hidden points; the same object where there are none.

    Parameters
    ----------
    scene : Scene
        Without details.
    triangle, barycentric, back : (n,), (n, 2), (n,)
        Where they lie, on sides that receive light (see `Details`).
    """
    if not len(triangle):
        return scene
    points, _ = surface_points(scene, triangle, barycentric, back)
    points = replace(points, visible=np.zeros(len(points), bool))
    new = np.arange(len(scene.points), len(scene.points) + len(points), dtype=np.int32)
    where = triangle.astype(np.int32), barycentric.astype(np.float32), back.astype(bool)
    detailed = replace(scene, points=joined(scene.points, points), details=Details(new, *where))
    detailed.frames = scene.frames
    return detailed
