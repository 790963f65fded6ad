"""Haar-like wavelets on points in space: an orthonormal basis for any mesh, without parameters.

Points are sorted so that each half, quarter ... of the sequence is a compact patch. A step joins
neighbouring pairs of nodes: their weighted mean goes on, their difference stays. (Girardi &
Sweldens 1997, unbalanced Haar wavelets, on a tree as in Gavish et al. 2010.)
"""

import numpy as np

from prt_core.basis.wavelets import all_steps, expect_array_of
from prt_core.errors import expect, expect_array

# Normals count as much as so much of the scene's size.
_NORMAL_SHARE = 0.15


class PointHaar:
    """The transform of functions on points; offers what `ImageWavelet` offers.

    Vectors are in the order of the points; coefficients in that of the tree.

    Parameters
    ----------
    positions : (n, 3) float
    normals : (n, 3) float, optional
        Points that look elsewhere are kept apart, like those of other groups.
    groups : (n,) int, optional
        Objects.

    Attributes
    ----------
    n, depth : int
    order : (n,) int64
        Point of each leaf.
    """

    orthonormal = True
    # What it is called in settings.
    name = "haar"
    # Another transform on the same order, that a column may rather take.
    haar = None

    def __init__(self, positions, normals=None, groups=None):
        positions = expect_array("positions", positions, (None, 3), np.float64)
        n = len(positions)
        expect(n, "positions: expected at least one point")
        size = np.ptp(positions, axis=0).max(initial=0) or 1.0
        features = [positions / size]
        if normals is not None:
            normals = expect_array("normals", normals, (n, 3), np.float64)
            features.append(_NORMAL_SHARE * normals)
        if groups is not None:
            groups = expect_array("groups", groups, (n,), np.int64)
            features.append(2.0 * groups[:, None])
        depth = max(n - 1, 0).bit_length()
        self._plant(_tree_order(np.hstack(features), depth))

    @classmethod
    def from_order(cls, order):
        """The transform whose leaves are the points in `order`, a permutation of 0 to n - 1."""
        order = expect_array("order", order, (None,), np.int64)
        expect((np.sort(order) == np.arange(len(order))).all(), "order: expected every point once")
        self = cls.__new__(cls)
        self._plant(order)
        return self

    def _plant(self, order):
        self.n, self.order = len(order), order
        self.depth = max(self.n - 1, 0).bit_length()
        self._sizes = [self.n]
        self._weights = []
        counts = np.ones(self.n)
        for _ in range(self.depth):
            pairs = len(counts) // 2
            left, right = counts[0 : 2 * pairs : 2], counts[1 : 2 * pairs : 2]
            total = left + right
            self._weights.append((np.sqrt(left / total), np.sqrt(right / total)))
            counts = np.concatenate([total, counts[2 * pairs :]])
            self._sizes.append(len(counts))

    def forward_step(self, vectors, level):
        """One step down, in place: (m, n) vectors in the order of the tree, at a `level`."""
        size, half = self._sizes[level], self._sizes[level + 1]
        left, right = (w.astype(vectors.dtype) for w in self._weights[level])
        pairs = size // 2
        a, b = vectors[:, 0 : 2 * pairs : 2].copy(), vectors[:, 1 : 2 * pairs : 2].copy()
        # An odd node at the end has no partner and goes on as it is.
        vectors[:, pairs:half] = vectors[:, 2 * pairs : size].copy()
        vectors[:, :pairs] = left * a + right * b
        vectors[:, half:size] = right * a - left * b
        return vectors

    def inverse_step(self, vectors, level):
        """Undo `forward_step(vectors, level)`, in place."""
        size, half = self._sizes[level], self._sizes[level + 1]
        left, right = (w.astype(vectors.dtype) for w in self._weights[level])
        pairs = size // 2
        mean, difference = vectors[:, :pairs].copy(), vectors[:, half:size].copy()
        vectors[:, 2 * pairs : size] = vectors[:, pairs:half].copy()
        vectors[:, 0 : 2 * pairs : 2] = left * mean + right * difference
        vectors[:, 1 : 2 * pairs : 2] = right * mean - left * difference
        return vectors

    def forward(self, vectors, depth=None):
        """Coefficients after `depth` steps (None: all) of (..., n) vectors in the points' order."""
        return all_steps(self, expect_array_of(vectors, self.n)[..., self.order], depth, False)

    def inverse(self, coefficients, depth=None):
        """Functions (..., n) in the points' order of `coefficients` after `depth` steps."""
        result = np.empty_like(expect_array_of(coefficients, self.n))
        result[..., self.order] = all_steps(self, coefficients, depth, True)
        return result

    def head(self, vectors, depth):
        """The part of (m, n) vectors that step `depth` changes: (m, k), no copy."""
        return vectors[:, : self._sizes[depth]]

    def weights(self, depth):
        """(n,) float32: energy of what a coefficient of one after `depth` steps stands for."""
        return np.ones(self.n, np.float32)

    def scales(self, depth):
        """(n,) int: 0 for scaling coefficients after `depth` steps, half a level a step: two
        steps here halve a patch's width as one step does an image's."""
        result = np.zeros(self.n, int)
        for level in range(depth):
            result[self._sizes[level + 1] : self._sizes[level]] = (depth - level + 1) // 2
        return result


def _tree_order(features, depth):
    """Leaves from left to right: nodes of 2^k leaves are halved across their principal axis."""
    n = len(features)
    order = np.arange(n)
    for level in range(depth, 1, -1):
        whole = n >> level << level
        # All nodes of a level at once, then the last one, if it has fewer leaves.
        for nodes in (order[:whole].reshape(-1, 1 << level), order[None, whole:]):
            if nodes.shape[1] > 1 << (level - 1):
                node_features = features[nodes]
                node_features -= node_features.mean(axis=1, keepdims=True)
                axes = np.linalg.eigh(node_features.swapaxes(1, 2) @ node_features)[1][:, :, -1:]
                largest = np.abs(axes).argmax(axis=1)[:, None]
                axes *= np.sign(np.take_along_axis(axes, largest, axis=1))
                along = (node_features @ axes)[:, :, 0]
                nodes[:] = np.take_along_axis(nodes, along.argsort(axis=1, kind="stable"), axis=1)
    return order
