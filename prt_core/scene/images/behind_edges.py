"""Where the surface goes on behind an edge at which a chart ends and another begins.

A bilinear lookup on the border of a chart lies between a texel inside of it and one outside. Where
the one outside shows the surface on the other side of the edge, as far behind it as the texel is,
what is looked up is what is on the edge, up to what changes twice; a texel that shows the edge
itself would give what is a quarter of a texel inside.
"""

import numpy as np

# Barycentric weights of places on the other side, so that rays start above its triangle: of its far
# corner, and along the edge. Triangles smaller than a texel are not walked over.
_FAR, _ALONG = (0.05, 0.7), (0.02, 0.98)
_TINY = 1e-30


def behind_edges(middles, border, sides, places, corners):
    """Places behind edges, as if the triangles of both sides lay in one plane.

    Parameters
    ----------
    middles : (m, 2) float
        Columns and rows of texels outside of a chart.
    border : (m,) int
        The edge that each is nearest to: 3 t + k is that of triangle t from corner k to the next.
    sides : (2, 2, n_edges) int
        Corners of edges that are there twice (see `common_edges`).
    places : (n, 3, 2) float
        Corners of triangles in the image.
    corners : (n, 3, 3) float
        The same on the surface.

    Returns
    -------
    behind : (k,) int64
        Those of the texels behind whose edge the surface goes on.
    triangle : (k,) int64
        The one there.
    weights : (k, 3) float64
        Barycentric, of its corners.
    """
    here, there = np.concatenate([sides, sides[::-1]], axis=2)
    edge = np.full(3 * len(places), -1)
    edge[_numbers(here)] = np.arange(here.shape[1])
    behind = np.flatnonzero(edge[border] >= 0)
    here, there = (side[:, edge[border[behind]]] for side in (here, there))
    # Where the texel would be on this side's plane, along the edge and beside it, in its lengths.
    along, beside = _from_edge(middles[behind], places.reshape(-1, 2)[_with_third(here)])
    foot, height = _third(corners, here)
    along, beside = np.clip(along - beside * foot, 0, 1), beside * height
    # And there on the other side's.
    foot, height = _third(corners, there)
    up = np.clip(beside / np.maximum(height, _TINY), *_FAR)
    across = np.clip((along - up * foot) / (1 - up), *_ALONG)
    weights, row = np.empty((len(behind), 3)), np.arange(len(behind))
    start, stop, far = _with_third(there) % 3
    weights[row, start], weights[row, stop] = (1 - up) * (1 - across), (1 - up) * across
    weights[row, far] = up
    return behind, there[0] // 3, weights


def _numbers(ends):
    """(n,) edges by their two corners, in either order: the one that comes first around."""
    following = ends[0] - ends[0] % 3 + (ends[0] + 1) % 3
    return np.where(following == ends[1], ends[0], ends[1])


def _with_third(ends):
    """(3, n) corners of edges with the one of the triangle that is on neither end."""
    return np.stack([*ends, 3 * (ends[0] // 3) + 3 - ends[0] % 3 - ends[1] % 3])


def _third(corners, ends):
    """How far along an edge the third corner of its triangle is, and how far beside it, both in
    lengths of the edge."""
    start, stop, far = corners.reshape(-1, 3)[_with_third(ends)].astype(np.float64)
    side, reach = stop - start, far - start
    squared = np.maximum((side**2).sum(axis=1), _TINY)
    foot = (reach * side).sum(axis=1) / squared
    return foot, np.sqrt(((reach - foot[:, None] * side) ** 2).sum(axis=1) / squared)


def _from_edge(middles, triangles):
    """Barycentric weights of places outside of flat triangles: of the second corner, and of the
    third with the other sign."""
    start, stop, far = triangles
    side, reach, place = stop - start, far - start, middles - start
    area = side[:, 0] * reach[:, 1] - side[:, 1] * reach[:, 0]
    area = np.where(np.abs(area) < _TINY, _TINY, area)
    second = (place[:, 0] * reach[:, 1] - place[:, 1] * reach[:, 0]) / area
    third = (side[:, 0] * place[:, 1] - side[:, 1] * place[:, 0]) / area
    return second, np.maximum(-third, 0)
