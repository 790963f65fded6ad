"""Equation 4 for all points at once, between cells: sparse products with blocks of points.

The element between four cells of H = U S V^T is u S v^T with u and v between two rows of U and V.
Over all points these are one product with a block-diagonal matrix of all S, which is sparse and
stays as it is; a view only changes which rows of U and V each point takes.
"""

import numpy as np
from scipy.sparse import csr_array

from prt_core.lightfield.hrdf import split_places
from prt_core.runtime.threads import on_all_cores

# Points of a block: what they read stays in a core's cache.
_BLOCK = 4096


class PairProducts:
    """The sparse matrices of one channel, ready for views.

    Parameters
    ----------
    left : (n_bases, m1, m1) float32
    right : (n_bases, m2, m2) float32
    rows : SparseRows
    step : float
        What their numbers are multiples of.
    """

    def __init__(self, left, right, rows, step):
        # Columns beyond the last that is used are zeros only.
        m1, m2 = left.shape[1], right.shape[1]
        self._i, self._j = np.divmod(rows.places, m2)
        width, height = int(self._i.max(initial=0)) + 1, int(self._j.max(initial=0)) + 1
        self._sizes = m1, m2
        self._left = np.ascontiguousarray(left[:, :, :width].reshape(-1, width))
        self._right = np.ascontiguousarray(right[:, :, :height].reshape(-1, height))
        n = len(rows.basis)
        self._blocks, values = [], rows.values(step)
        for first in range(0, n, _BLOCK):
            part = slice(first, min(first + _BLOCK, n))
            self._blocks.append((part, rows.basis[part], self._matrix(rows, values, part)))

    def _matrix(self, rows, values, part):
        """(points, j) x (points, i) of the S of a block of points."""
        height, width = self._right.shape[1], self._left.shape[1]
        count = part.stop - part.start
        here = slice(rows.starts[part.start], rows.starts[part.stop])
        point = np.repeat(np.arange(count), np.diff(rows.starts[part.start : part.stop + 1]))
        places = point * height + self._j[here], point * width + self._i[here]
        return csr_array((values[here], places), shape=(count * height, count * width))

    def interpolated(self, row, column):
        """(n_points,) float32 between cells, at places `row` and `column` (n_points,) float32."""
        result = np.empty(len(row), np.float32)

        def block(each):
            part, basis, matrix = each
            left = _between(self._left, basis, row[part], self._sizes[0])
            right = _between(self._right, basis, column[part], self._sizes[1])
            half = (matrix @ left.ravel()).reshape(right.shape)
            np.einsum("nj,nj->n", half, right, out=result[part])

        on_all_cores(block, self._blocks)
        return result


def _between(table, basis, places, count):
    """(n, width) float32: rows of each point's basis in a table, between two of them."""
    n = len(places)
    first, share = split_places(np.array(places, np.float32), count)
    indices, weights = np.empty((n, 2), np.int32), np.empty((n, 2), np.float32)
    np.add(first, basis * count, out=indices[:, 0])
    np.add(indices[:, 0], int(count > 1), out=indices[:, 1])
    np.subtract(1, share, out=weights[:, 0])
    weights[:, 1] = share
    starts = np.arange(0, 2 * n + 1, 2, dtype=np.int32)
    picked = csr_array((weights.ravel(), indices.ravel(), starts), shape=(n, len(table)))
    return picked @ table
