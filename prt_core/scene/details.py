"""Hidden points inside triangles, where those around a hit do not tell what it looks like."""

from dataclasses import dataclass, fields, replace

import numpy as np

from prt_core.scene.points import BakePoints


@dataclass(frozen=True)
class Details:
    """Bake points that show a place inside a triangle.

    Attributes
    ----------
    point : (n,) int32
        Bake points; none is visible.
    triangle : (n,) int32
    """

    point: np.ndarray
    triangle: np.ndarray

    def __len__(self):
        return len(self.point)


def no_details():
    """Those of a scene that has none."""
    return Details(np.zeros(0, np.int32), np.zeros(0, np.int32))


def with_details(scene, points, triangle):
    """The scene with more hidden points.

    Parameters
    ----------
    scene : Scene
    points : BakePoints
    triangle : (n,) int
        That each of them lies in.
    """
    first = len(scene.points)
    new = np.arange(first, first + len(points), dtype=np.int32)
    known = scene.details
    return replace(
        scene,
        points=joined(scene.points, points),
        details=Details(
            np.concatenate([known.point, new]),
            np.concatenate([known.triangle, triangle]).astype(np.int32),
        ),
    )


def joined(points, more):
    """`BakePoints` one after the other."""
    return BakePoints(
        **{
            f.name: np.concatenate([getattr(points, f.name), getattr(more, f.name)])
            for f in fields(BakePoints)
        }
    )
