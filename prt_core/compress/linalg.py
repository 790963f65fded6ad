"""Small decompositions of tall or flat matrices, by their Gram matrix in float64."""

import numpy as np


def orthonormal_columns(matrix):
    """An orthonormal basis of the columns of a tall matrix.

    Parameters
    ----------
    matrix : (n, k) float

    Returns
    -------
    (n, k') float32
        k' <= k: directions whose size is rounding error only are left out. Twice by the Gram
        matrix, as accurate as Householder's QR where k' columns are kept, and many times faster.
    """
    for _ in range(2):
        squares, vectors = np.linalg.eigh(_gram(matrix))
        kept = squares > 1e-11 * max(squares[-1], 1e-300)
        matrix = matrix @ (vectors[:, kept] / np.sqrt(squares[kept])).astype(matrix.dtype)
    return np.asarray(matrix, np.float32)


def principal_rows(matrix, rank):
    """The strongest right singular vectors of a matrix.

    Parameters
    ----------
    matrix : (n, m) float32
    rank : int

    Returns
    -------
    rows : (k, m) float32
        Orthonormal; k <= rank, only directions above rounding error.
    energies : (k,) float64
        Squares of the singular values, decreasing.
    """
    n, m = matrix.shape
    if min(n, m, rank) == 0:
        return np.zeros((0, m), np.float32), np.zeros(0)
    flat = n <= m
    gram = _gram(matrix.T if flat else matrix)
    squares, vectors = _largest(gram, min(rank, n, m))
    kept = squares > 1e-10 * max(squares[0], 1e-300)
    squares, vectors = squares[kept], vectors[:, kept]
    rows = (matrix.T @ vectors.astype(np.float32)) if flat else vectors
    return orthonormal_columns(rows).T.copy() if flat else rows.T.astype(np.float32), squares


def _largest(gram, count):
    """The largest eigenvalues, decreasing, and their eigenvectors as columns."""
    n = len(gram)
    if n > 3 * count + 64:
        from scipy.linalg import eigh

        squares, vectors = eigh(gram, subset_by_index=[n - count, n - 1], check_finite=False)
    else:
        squares, vectors = np.linalg.eigh(gram)
        squares, vectors = squares[-count:], vectors[:, -count:]
    return np.maximum(squares[::-1], 0), vectors[:, ::-1]


def _gram(matrix):
    """Columns times columns: products in float32 of blocks of rows, summed in float64."""
    total = np.zeros((matrix.shape[1],) * 2)
    for first in range(0, len(matrix), 4096):
        part = matrix[first : first + 4096]
        total += part.T @ part
    return total
