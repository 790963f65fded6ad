"""Points from which nothing can be in the way: the whole scene lies below their tangent plane."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from prt_core.errors import expect_kind
from prt_core.scene.scene import RAY_OFFSET, Scene

# Points tested against the hull at once.
_BLOCK = 1 << 12


def open_points(scene):
    """Points whose rays above the geometric horizon can meet no triangle.

    A proof, not a guess: no vertex of the scene's convex hull rises above the plane through the
    point, so none of a convex body's points needs a ray, and none of a lone floor's.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    (n_points,) bool
    """
    expect_kind("scene", scene, Scene)
    points = scene.points
    corners = scene.vertices[np.unique(scene.triangles)].astype(np.float64)
    try:
        corners = corners[ConvexHull(corners).vertices]
    except QhullError:
        # All in one plane or line: the corners themselves will do.
        pass
    result = np.empty(len(points), bool)
    for first in range(0, len(points), _BLOCK):
        part = slice(first, first + _BLOCK)
        normals = points.geometric_normals[part].astype(np.float64)
        # Rays start RAY_OFFSET above the plane: half of it is left for rounding.
        height = np.einsum("nx,nx->n", normals, points.positions[part].astype(np.float64))
        top = np.full(len(normals), -np.inf)
        for start in range(0, len(corners), _BLOCK):
            above = normals @ corners[start : start + _BLOCK].T
            np.maximum(top, above.max(axis=1), out=top)
        result[part] = top <= height + RAY_OFFSET / 2
    return result
