"""Many small least-squares problems at once, of any rank."""

import numpy as np

from prt_core.reconstruct.l1_batched import expect_problems

# Directions in which the columns are this small, squared and relative, are noise of float32.
_CUT = 1e-12


def least_squares(grams, moments):
    """Weights of least norm among those that minimise |A w - y| for each of n problems.

    Parameters
    ----------
    grams : (n, k, k) float64
    moments : (n, k) float64
        See `gram`. Columns of zeros, equal columns and more columns than rows are allowed.

    Returns
    -------
    weights : (n, k) float64
    slope : (n,) float64
        The certificate: the largest entry of |A^T (A w - y)|, as a share of that of |A^T y|. It
        is zero at a minimum; what stays is what the cut at singular values of 1e-6 leaves.
    """
    grams, moments = expect_problems(grams, moments)
    values, vectors = np.linalg.eigh(grams)
    largest = np.maximum(values[:, -1:], 1e-300)
    inverse = np.where(values > _CUT * largest, 1 / np.maximum(values, 1e-300), 0)
    along = (vectors.transpose(0, 2, 1) @ moments[:, :, None])[:, :, 0]
    weights = (vectors @ (inverse * along)[:, :, None])[:, :, 0]
    rest = np.abs(np.einsum("nij,nj->ni", grams, weights) - moments).max(axis=1, initial=0)
    return weights, rest / np.maximum(np.abs(moments).max(axis=1, initial=0), 1e-300)
