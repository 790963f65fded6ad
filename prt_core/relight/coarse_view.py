"""Views in a hurry: lobes of every so many-th glossy point, and what lies between from those."""

import numpy as np
from scipy.sparse import csr_matrix

from prt_core.sampling.neighbours import Neighbours, morton

# Neighbours that a point between takes its colours from, of so many that are nearest.
_AROUND, _CANDIDATES = 3, 6


class CoarseView:
    """Which glossy points lobes are evaluated at, and how the others follow.

    They are spread evenly over each object, and followed by points near to them in place and
    normal. Where no neighbour is within reach, a point is evaluated itself.

    Parameters
    ----------
    points : BakePoints
    glossy : (n,) int
        The points that have lobes.
    every : int
        One of so many is evaluated.

    Attributes
    ----------
    chosen : (n_points,) bool
        The points to evaluate.
    """

    def __init__(self, points, glossy, every):
        glossy, groups = np.sort(np.asarray(glossy, np.int64)), points.object_index
        places = points.positions[glossy]
        places = places - places.min(axis=0)
        curve = morton(places, np.full(len(places), places.max()))
        order = glossy[np.lexsort((curve, groups[glossy]))]
        self.chosen = np.zeros(len(points), bool)
        self.chosen[order[every // 2 :: every]] = True
        known, rest = np.flatnonzero(self.chosen), glossy[~self.chosen[glossy]]
        around = Neighbours(points, groups).around(known, rest, _AROUND, _CANDIDATES)
        alone = around[:, 0] < 0
        self.chosen[rest[alone]] = True
        self._known, self._rest = known, rest[~alone]
        self._weights = self._weights_of(points.positions, around[~alone])

    def _weights_of(self, positions, around):
        """(n_rest, n_known) sparse: by the inverse of the squared distance."""
        there = around >= 0
        ways = positions[around] - positions[self._rest, None]
        squared = np.einsum("nkx,nkx->nk", ways, ways)
        least = 1e-6 * max(float(squared.max(initial=0)), 1e-30)
        weights = np.where(there, 1 / (squared + least), 0)
        weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-30)
        columns = np.searchsorted(self._known, around[there])
        start = np.concatenate([[0], np.cumsum(there.sum(axis=1))])
        shape = len(self._rest), len(self._known)
        return csr_matrix((weights[there].astype(np.float32), columns, start), shape)

    def follow(self, values, facing, known_besides=None):
        """Fill in what was not evaluated.

        Parameters
        ----------
        values : (n_points, n_channels) float32
            Changed in place at the points that were not evaluated and face the viewer.
        facing : (n_points,) bool
            Points that do not face the viewer are not followed.
        known_besides : (n_points,) bool, optional
            Points that stay as they are.
        """
        known = facing[self._known]
        share = self._weights @ known.astype(np.float32)
        mean = self._weights @ np.where(known[:, None], values[self._known], np.float32(0))
        seen = facing[self._rest] & (share > 0)
        if known_besides is not None:
            seen &= ~known_besides[self._rest]
        values[self._rest[seen]] = mean[seen] / share[seen, None]
