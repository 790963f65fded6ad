"""Wavelets on points whose details vanish on what depends linearly on normal and place.

Light that nothing blocks is linear in the normal, and what else the transport holds is often
nearly so in a small patch. Where a Haar wavelet keeps one function a node, the constant, these keep
three: the constant and the two that normals and positions need most there. (After Alpert, Beylkin,
Coifman & Rokhlin 1993, on a tree of points, and with the functions of the transport instead of
polynomials.)
"""

import numpy as np
import scipy.sparse as sp

from prt_core.basis.point_haar import PointHaar
from prt_core.basis.wavelets import all_steps
from prt_core.errors import expect, expect_array, expect_numbers

# Functions that a node keeps.
_KEPT = 3
# What is smaller, relative to all of a node's functions, is rounding.
_NOTHING = 1e-9


class PointMultiwavelet(PointHaar):
    """The transform of functions on points; offers what `PointHaar` offers.

    Parameters
    ----------
    positions : (n, 3) float
    normals : (n, 3) float, optional
    groups : (n,) int, optional
        See `PointHaar`.

    Attributes
    ----------
    haar : PointHaar
        On the same tree: what changes abruptly everywhere is sparser there.
    features : (n, k) int8
        What is kept of the normals (times 127) and of the positions (in 254ths of the longest
        side) to make the basis anew; what is the same at all points is left out.
    """

    name = "multiwavelet"

    def __init__(self, positions, normals=None, groups=None):
        positions = expect_array("positions", positions, (None, 3), np.float64)
        tree = PointHaar(positions, normals, groups)
        middle = (positions.max(axis=0) + positions.min(axis=0)) / 2
        size = np.ptp(positions, axis=0).max(initial=0) or 1.0
        features = [254 * (positions - middle) / size]
        if normals is not None:
            features.insert(0, 127 * expect_array("normals", normals, (None, 3), np.float64))
        features = np.rint(np.hstack(features)).clip(-127, 127).astype(np.int8)
        self._plant(tree.order, features[:, (features != features[:1]).any(axis=0)])

    @classmethod
    def from_order(cls, order, features):
        """The transform with leaves in `order` (n,) and `features` (n, k) int8, as it was."""
        order = expect_array("order", order, (None,), np.int64)
        features = expect_numbers("features", features)
        expect(
            features.ndim == 2 and features.dtype == np.int8 and len(features) == len(order),
            f"features: expected ({len(order)}, k) int8, got {features.shape} {features.dtype}",
        )
        self = cls.__new__(cls)
        self._plant(order, features)
        return self

    def check(self):
        """A number by which to tell whether the same basis was made of the same features."""
        places = np.arange(self.n)
        return float(all_steps(self, np.cos(places)[None], None, False)[0] @ np.sin(2 * places))

    def _plant(self, order, features):
        self.n, self.order, self.features = len(order), order, features
        self.haar = PointHaar.from_order(order)
        self.depth = max(self.n - 1, 0).bit_length()
        self._sizes, self._turns = [self.n], []
        moments = np.insert(features[order].astype(np.float64), 0, 1.0, axis=1)[:, None]
        # (nodes, functions kept, functions): all nodes keep as many but the last, which may be
        # of fewer points.
        nodes, last = moments[:-1], moments[-1:]
        for _ in range(self.depth):
            pairs = len(nodes) // 2
            n_kept, n_functions = nodes.shape[1:]
            joined = nodes[: 2 * pairs].reshape(pairs, 2 * n_kept, n_functions)
            blocks = [_turns(joined)]
            nodes, rest = blocks[0][1][:, :_KEPT], nodes[2 * pairs :]
            if len(rest):
                blocks.append(_turns(np.concatenate([rest, last], axis=1)))
                last = blocks[1][1][:, :_KEPT]
            turn, n_kept = _matrix([turn for turn, _ in blocks], self._sizes[-1])
            self._turns.append((turn.astype(np.float32), turn))
            self._sizes.append(n_kept)

    def forward_step(self, vectors, level):
        """One step down, in place: (m, n) vectors in the order of the tree, at a `level`."""
        return self._step(vectors, level, lambda turn: turn)

    def inverse_step(self, vectors, level):
        """Undo `forward_step(vectors, level)`, in place."""
        return self._step(vectors, level, lambda turn: turn.T)

    def _step(self, vectors, level, way):
        turn = way(self._turns[level][vectors.dtype != np.float32])
        head = self.head(vectors, level)
        head[:] = (turn @ head.T).T
        return vectors


def _turns(moments):
    """Orthonormal bases in which each node's functions are triangular, the strongest first.

    Householder reflections with pivoting. A basis must come out the same on every machine, so no
    choice may hang on rounding where nodes are symmetric: ties go to the first function, and signs
    change where no symmetry leads.

    Parameters
    ----------
    moments : (n, k, q) float64
        Of q functions with k orthonormal ones; the first of them is the constant.

    Returns
    -------
    turns : (n, k, k) float64
        The new basis, as rows.
    moments : (n, k, q) float64
        With it.
    """
    n, k, _ = moments.shape
    moments = moments.copy()
    turns = np.tile(np.eye(k), (n, 1, 1))
    nothing = _NOTHING * np.sqrt((moments**2).sum(axis=(1, 2)))
    for j in range(k - 1):
        squares = (moments[:, j:] ** 2).sum(axis=1)
        most = squares.max(axis=1, keepdims=True)
        pivot = (squares >= (1 - 1e-6) * most).argmax(axis=1) if j else np.zeros(n, int)
        axis = np.take_along_axis(moments[:, j:], pivot[:, None, None], axis=2)[..., 0]
        length = np.linalg.norm(axis, axis=1)
        axis[:, 0] += np.where(axis[:, 0] > -0.1234567 * length, length, -length)
        # Where nothing is left any basis will do: the one that is there.
        share = np.divide(2, (axis**2).sum(axis=1), where=length > nothing, out=np.zeros(n))
        for array in (moments, turns):
            along = share[:, None, None] * (axis[:, None] @ array[:, j:])
            array[:, j:] -= axis[:, :, None] * along
    return turns, moments


def _matrix(blocks, size):
    """One step as a sparse matrix: what is kept first, then the details; and how much is kept."""
    before, kept, details = 0, [], []
    parts = []
    for turns in blocks:
        n, k, _ = turns.shape
        place = before + np.arange(n * k).reshape(n, k)
        parts.append((turns, place))
        kept.append(place[:, :_KEPT].ravel())
        details.append(place[:, _KEPT:].ravel())
        before += n * k
    # A node without a partner goes on as it is.
    kept.append(np.arange(before, size))
    parts.append((np.ones((size - before, 1, 1)), np.arange(before, size)[:, None]))
    order = np.concatenate(kept + details)
    row = np.empty(size, int)
    row[order] = np.arange(size)
    rows = [np.repeat(row[place], place.shape[1]) for _, place in parts]
    columns = [np.repeat(place, place.shape[1], axis=0).ravel() for _, place in parts]
    values = np.concatenate([turns.ravel() for turns, _ in parts])
    entries = values, (np.concatenate(rows), np.concatenate(columns))
    return sp.csr_matrix(entries, shape=(size, size)), sum(map(len, kept))
