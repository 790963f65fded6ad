"""Points from which nothing can be in the way: the whole scene lies below their tangent plane."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from prt_core.scene.stack import parts_of_triangles

# What rises above the tangent plane by less than this share of its distance is rounding: that of
# normals, and of planes far away. Light so near the horizon is a hundred-millionth of the whole.
_RISE = 1e-4
# Planes tested at once, and vertices they are tested against; pairs at most. A proof that would
# cost more is not sought: the rays are cast.
_BLOCK, _MOST = 1 << 11, 1 << 31


def open_points(scene):
    """Points whose rays above the geometric horizon can meet no triangle.

    A proof, not a guess: no vertex of the scene rises above the plane through the point, so none
    of a convex body's points needs a ray, and none of a lone floor's. Heights count by what rays
    start above the surface, which is rounding, and far from a triangle by the share of its
    distance; so nothing is too small, too near or too low to be seen.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    (n_points,) bool
    """
    points = scene.points
    used = np.zeros(len(scene.vertices), bool)
    used[scene.triangles] = True
    corners = scene.vertices[used]
    normals = points.geometric_normals.astype(np.float64)
    height = np.einsum("nx,nx->n", normals, points.positions)
    lift = np.einsum("nx,nx->n", normals, points.ray_offset)
    # Most points have something of the hull well above their plane, however far it is.
    far = 2 * np.sqrt(3) * np.abs(corners).max()
    candidates = np.flatnonzero(_highest(normals, _hull(corners)) <= height + lift + _RISE * far)
    result = np.zeros(len(points), bool)
    edges = _longest_edges(scene)[used]
    for members in _planes(normals, height, lift, candidates)[: max(1, _MOST // len(corners))]:
        normal = normals[members[0]]
        rise = corners @ normal - height[members].min()
        # The lowest of these points is a quarter of their lift below the highest, at most.
        over = np.flatnonzero(rise > lift[members].min() * 0.75)
        result[members] = not len(over) or _none_rises(
            points.positions[members], rise[over], corners[over], edges[over]
        )
    return result


def _planes(normals, height, lift, chosen):
    """Those of some points that lie in one plane, together; those of most points first."""
    step = np.maximum(lift[chosen], 1e-30) / 4
    key = np.column_stack([normals[chosen], step, np.floor(height[chosen] / step)])
    _, plane, counts = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(plane.reshape(-1), kind="stable")
    groups = np.split(chosen[order], np.cumsum(counts)[:-1]) if len(chosen) else []
    return sorted(groups, key=len, reverse=True)


def _hull(corners):
    """The corners of the convex hull."""
    try:
        return corners[ConvexHull(corners).vertices]
    except QhullError:
        # All in one plane or line: the corners themselves will do.
        return corners


def _highest(normals, corners):
    """(n,) the most that any corner rises along each normal."""
    top = np.full(len(normals), -np.inf)
    for first in range(0, len(normals), _BLOCK):
        part = slice(first, first + _BLOCK)
        for start in range(0, len(corners), _BLOCK):
            above = normals[part] @ corners[start : start + _BLOCK].T
            np.maximum(top[part], above.max(axis=1), out=top[part])
    return top


def _longest_edges(scene):
    """(n_vertices,) the longest edge of the triangles at each vertex."""
    longest = np.zeros(len(scene.vertices))
    for part in parts_of_triangles(len(scene.triangles)):
        triangles = scene.triangles[part]
        corners = scene.vertices[triangles]
        edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        np.maximum.at(longest, triangles.ravel(), np.repeat(edge, 3))
    return longest


def _none_rises(places, rise, corners, edges):
    """(n,) bool: whether no corner rises by more than a share of how far its triangles are."""
    result = np.ones(len(places), bool)
    for first in range(0, len(places), _BLOCK):
        part = slice(first, first + _BLOCK)
        for start in range(0, len(corners), _BLOCK):
            block = slice(start, start + _BLOCK)
            apart = places[part, None] - corners[None, block]
            away = np.sqrt(np.einsum("nvx,nvx->nv", apart, apart)) - edges[block]
            result[part] &= ~(rise[block] > _RISE * away).any(axis=1)
    return result
