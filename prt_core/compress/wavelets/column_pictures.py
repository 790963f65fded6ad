"""Sparse columns at depths of their own, times a light and transformed back.

Equation 8 of Cheslack-Postava et al. (2007): the deepest columns first, one inverse step between
two depths, so that a frame has one inverse transform and not one for each column.
"""

import numpy as np
import scipy.sparse as sp

from prt_core.compress.wavelets.sparse_columns import parts_of_terms
from prt_core.runtime.threads import on_all_cores


def columns_by_depth(groups, weights, decode):
    """The columns that have a weight, unpacked on all cores.

    Parameters
    ----------
    groups : list of ((m,) int depths, rising, and SparseColumns of m columns)
    weights : (n_names, n_outputs) float32
    decode : callable
        What stored values stand for, array to array.

    Returns
    -------
    dict of int -> ((n_rows, k) CSC, (k, n_outputs) float32)
    """
    pieces = []
    for depths, packed in groups:
        light = weights[packed.names] * packed.sizes[:, None]
        lit = np.flatnonzero(light.any(axis=1))
        pieces += [
            (packed, part, depths[part], light[part])
            for part in parts_of_terms(lit, packed.counts[lit])
        ]

    def unpacked(piece):
        matrix = piece[0].matrix(piece[1])
        matrix.data = decode(matrix.data)
        return matrix

    pictures = {}
    matrices = on_all_cores(unpacked, pieces)
    for (_, _, depths, light), matrix in zip(pieces, matrices, strict=True):
        deep, firsts = np.unique(depths, return_index=True)
        for depth, a, b in zip(deep, firsts, [*firsts[1:], len(depths)], strict=True):
            terms = slice(matrix.indptr[a], matrix.indptr[b])
            starts = matrix.indptr[a:b] - matrix.indptr[a]
            lit = matrix.data[terms], matrix.indices[terms], starts, light[a:b]
            pictures.setdefault(int(depth), []).append(lit)
    n_rows = groups[0][1].n_rows if groups else 0
    return {depth: _joined(lit, n_rows) for depth, lit in pictures.items()}


def picture_of(columns, transform, n_outputs, level_scales=False):
    """(n_outputs, n_rows) float32: the sum of `columns_by_depth`, transformed back.

    Parameters
    ----------
    columns : dict
        Of depths from 0.
    transform
        Of columns: `n`, `inverse_step`, `scales`.
    n_outputs : int
    level_scales : bool
        Whether coefficients were multiplied by 2^scale before they were quantised.
    """
    picture, at = np.zeros((n_outputs, transform.n), np.float32), 0
    for depth, (matrix, light) in sorted(columns.items(), reverse=True):
        _invert(transform, picture, at, depth)
        product = (matrix @ light).T
        if level_scales:
            product = product * np.exp2(-transform.scales(depth).astype(np.float32))
        picture += product
        at = depth
    _invert(transform, picture, at, 0)
    return picture


def _invert(transform, picture, before, after):
    for level in range(before - 1, after - 1, -1):
        transform.inverse_step(picture, level)


def _joined(parts, n_rows):
    """One CSC of (values, places, starts, light) of columns side by side, and their light."""
    values, places, starts, light = zip(*parts, strict=True)
    ends = np.cumsum([0, *(len(bounds) for bounds in values)])
    starts = [bounds + first for bounds, first in zip(starts, ends, strict=False)]
    indptr = np.concatenate([*starts, ends[-1:]]).astype(np.int32)
    light = np.concatenate(light)
    shape = n_rows, len(light)
    return sp.csc_matrix((np.concatenate(values), np.concatenate(places), indptr), shape), light
