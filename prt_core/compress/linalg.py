"""Small decompositions of tall or flat matrices, by their Gram matrix in float64."""

import numpy as np

# Multiplications up to which a matrix is decomposed directly in float64.
_SMALL = 1 << 24
# Subspace iteration where the smaller side is so many times the rank: directions beyond the rank,
# and passes. What is left of rows of visibility is then larger by 2e-4 at most.
_FEW, _EXTRA, _PASSES = 6, 16, 2


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
        if not matrix.shape[1]:
            break
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
        Orthonormal, strongest first; k <= rank, only directions above rounding error.
    energies : (k,) float64
        Squares of the singular values, decreasing.
    """
    n, m = matrix.shape
    if min(n, m, rank) <= 0:
        return np.zeros((0, m), np.float32), np.zeros(0)
    if n * m * min(n, m) < _SMALL:
        _, values, rows = np.linalg.svd(matrix.astype(np.float64), full_matrices=False)
        kept = int((values[:rank] > 1e-6 * max(values[0], 1e-150)).sum())
        return rows[:kept].astype(np.float32), values[:kept] ** 2
    if _FEW * (rank + _EXTRA) < min(n, m):
        return _by_iteration(matrix, rank)
    flat = n <= m
    squares, vectors = _largest(_gram(matrix.T if flat else matrix), min(rank, n, m))
    # The Gram matrix knows singular values to the root of float32's precision.
    kept = squares > 1e-6 * max(squares[0], 1e-300)
    squares, vectors = squares[kept], vectors[:, kept]
    if not flat or not len(squares):
        return vectors.T.astype(np.float32).reshape(-1, m), squares
    rows = matrix.T @ (vectors / np.sqrt(squares)).astype(np.float32)
    # Nearly orthonormal; the nearest orthonormal ones keep their order (Lowdin 1950).
    sizes, turn = np.linalg.eigh(_gram(rows))
    rows = rows @ (turn / np.sqrt(sizes) @ turn.T).astype(np.float32)
    return np.ascontiguousarray(rows.T), squares


def _by_iteration(matrix, rank):
    """The same by randomised subspace iteration (Halko et al. 2011); always the same start."""
    start = np.random.default_rng(0).standard_normal((rank + _EXTRA, len(matrix)), np.float32)
    basis = orthonormal_columns((start @ matrix).T)
    weights = matrix @ basis
    for _ in range(_PASSES):
        basis = orthonormal_columns((weights.T @ matrix).T)
        weights = matrix @ basis
    squares, turn = np.linalg.eigh(_gram(weights))
    squares, turn = squares[::-1][:rank], turn[:, ::-1][:, :rank]
    kept = squares > 1e-6 * max(squares[0], 1e-300) if len(squares) else slice(0)
    return np.ascontiguousarray((basis @ turn[:, kept].astype(np.float32)).T), squares[kept]


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
