"""Triangles of which rays pass a part, cut into pieces that rays pass wholly, in part or not.

A cut-out is geometry then: what is opaque is met as any triangle is, what is clear is not there,
and only the pieces on its rim ask what their opacity is. Pieces are cut again as long as they are
neither, down to single cells of the opacity, so that rims are thin and the rest is few pieces.
"""

from dataclasses import dataclass

import numpy as np

# Pieces of all triangles together, at most, unless whole triangles are more.
MOST_PIECES = 1 << 19


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


def pieces_of(opacity, triangles, most=MOST_PIECES):
    """`Pieces` of triangles, by their numbers, that let light pass (see `Opacity`).

    They are as fine as the opacity where that takes no more than `most` of them.
    """
    alike = np.stack([opacity.along, opacity.first, opacity.first_of_back])[:, triangles]
    patterns, first, pattern, count = np.unique(
        alike, axis=1, return_index=True, return_inverse=True, return_counts=True
    )
    pattern = pattern.ravel()
    groups = [np.flatnonzero(patterns[0] == n) for n in np.unique(patterns[0])]
    trees = [_Trees(opacity, triangles[first[group]]) for group in groups]
    for finest in sorted({k for tree in trees for k in tree.levels}, reverse=True):
        kept = [tree.pieces(finest) for tree in trees]
        total = sum(count[g[k[0]]].sum() for g, k in zip(groups, kept, strict=True))
        if total <= most:
            break
    owner = np.concatenate([g[k[0]] for g, k in zip(groups, kept, strict=True)])
    order = np.argsort(owner, kind="stable")
    n_pieces = np.bincount(owner, minlength=len(count))
    starts = np.cumsum(n_pieces) - n_pieces
    own = n_pieces[pattern]
    within = np.arange(own.sum()) - np.repeat(np.cumsum(own) - own, own)
    piece = order[np.repeat(starts[pattern], own) + within]
    corners, is_opaque = (np.concatenate([k[i] for k in kept])[piece] for i in (1, 2))
    return Pieces(np.repeat(triangles, own), corners, is_opaque)


class _Trees:
    """Triangles of equally many cells, each cut in ever smaller pieces.

    `levels` : pieces along an edge, from the whole triangle to its cells.
    """

    def __init__(self, opacity, triangles):
        n = int(opacity.along[triangles[0]])
        self.levels = _levels(n)
        self._steps = []
        # Whether each piece of the level before is neither clear nor opaque.
        mixed, before = np.ones((len(triangles), 1), bool), 1
        for k in self.levels:
            piece = opacity.cell_of(k, opacity.middles(n))
            order = np.argsort(piece, kind="stable")
            starts = np.searchsorted(piece[order], np.arange(k * k))
            cells = opacity.cells_of(triangles, order)
            opaque = np.minimum.reduceat(cells, starts, axis=2).min(axis=0) == opacity.opaque
            clear = np.maximum.reduceat(cells, starts, axis=2).max(axis=0) == 0
            there = mixed[:, opacity.cell_of(before, opacity.middles(k))]
            mixed, before = there & ~opaque & ~clear, k
            self._steps.append((k, there & opaque, mixed))

    def pieces(self, finest):
        """(row of the triangle, corners, is_opaque) of pieces of this level and those before."""
        steps = [step for step in self._steps if step[0] <= finest]
        parts = [(k, opaque, True) for k, opaque, _ in steps]
        parts.append((steps[-1][0], steps[-1][2], False))
        found = [(k, *np.nonzero(chosen), kind) for k, chosen, kind in parts]
        return (
            np.concatenate([row for _, row, _, _ in found]),
            np.concatenate([_corners(k)[piece] for k, _, piece, _ in found]),
            np.concatenate([np.full(len(row), kind) for _, row, _, kind in found]),
        )


def _levels(n):
    """Divisors of n from 1 to n, each of them divides the next."""
    levels, left, factor = [1], n, 2
    while left > 1:
        if left % factor:
            factor += 1
        else:
            left //= factor
            levels.append(levels[-1] * factor)
    return levels


def _corners(k):
    """(k^2, 3, 2) of the pieces of a triangle, in the order of its cells."""
    i, j = np.indices((k, k)).reshape(2, -1)
    upright = np.stack([[i, j], [i + 1, j], [i, j + 1]])
    a, b = k - 1 - i, k - 1 - j
    turned = np.stack([[a + 1, b + 1], [a, b + 1], [a + 1, b]])
    return np.moveaxis(np.where(i + j >= k, turned, upright), 2, 0) / k
