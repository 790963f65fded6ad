"""Triangles of which rays pass a part, cut into pieces that rays pass wholly, in part or not.

A cut-out is geometry then: what is opaque is met as any triangle is, what is clear is not there,
and only the pieces on its rim ask what their opacity is.
"""

from dataclasses import dataclass

import numpy as np

# Pieces along an edge, and of all triangles together, at most.
_ALONG, _ALL = 8, 1 << 20


@dataclass(frozen=True)
class Pieces:
    """Pieces of triangles.

    Attributes
    ----------
    triangle : (n,) int64
        That each is of.
    corners : (n, 3, 2) float64
        Weights of the triangle's second and third corner.
    is_opaque : (n,) bool
        Whether no light passes; those that all passes are left out.
    """

    triangle: np.ndarray
    corners: np.ndarray
    is_opaque: np.ndarray

    def positions(self, scene):
        """(3 n, 3) float64 of their corners, in the scene's frame."""
        a, b, c = np.moveaxis(scene.vertices[scene.triangles[self.triangle]], 1, 0)
        second, third = np.moveaxis(self.corners, 2, 0)[..., None]
        place = a[:, None] + second * (b - a)[:, None] + third * (c - a)[:, None]
        return place.reshape(-1, 3)


def pieces_of(opacity, triangles):
    """`Pieces` of triangles, by their numbers, that let light pass (see `Opacity`)."""
    parts, opaque, corners = [], [], []
    along = opacity.along[triangles]
    most = _ALONG
    while most > 1 and len(triangles) * most**2 > _ALL:
        most //= 2
    for n in np.unique(along):
        members = triangles[along == n]
        k = next(k for k in (8, 4, 2, 1) if k <= most and n % k == 0)
        piece = opacity.cell_of(int(k), opacity.middles(int(n)))
        order = np.argsort(piece, kind="stable")
        starts = np.searchsorted(piece[order], np.arange(k * k))
        shape = _corners(int(k))
        cells = opacity.cells_of(members, order)
        least = np.minimum.reduceat(cells, starts, axis=2).min(axis=0)
        largest = np.maximum.reduceat(cells, starts, axis=2).max(axis=0)
        row, kept = np.nonzero(largest > 0)
        parts.append(members[row])
        opaque.append(least[row, kept] == opacity.opaque)
        corners.append(shape[kept])
    return Pieces(np.concatenate(parts), np.concatenate(corners), np.concatenate(opaque))


def _corners(k):
    """(k^2, 3, 2) of the pieces of a triangle, in the order of its cells."""
    i, j = np.indices((k, k)).reshape(2, -1)
    upright = np.stack([[i, j], [i + 1, j], [i, j + 1]])
    a, b = k - 1 - i, k - 1 - j
    turned = np.stack([[a + 1, b + 1], [a, b + 1], [a + 1, b]])
    return np.moveaxis(np.where(i + j >= k, turned, upright), 2, 0) / k
