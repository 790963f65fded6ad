"""Orthonormal bases as reflections: half the numbers, and orthonormal however coarsely kept.

Householder's QR of an orthonormal matrix has a triangle of signs only, so that its columns are
those of a product of reflections (Householder 1958; Schreiber and Van Loan 1989). Reflection j has
m - 1 - j free numbers, none above 1. Rounding them turns the basis a little and never bends it.
"""

import numpy as np

from prt_core.errors import expect_whole

LEAST_BITS, MOST_BITS = 6, 16


def n_reflection_numbers(size, n_columns):
    """Free numbers of the first `n_columns` columns of a basis of `size` rows."""
    return sum(size - 1 - j for j in range(min(n_columns, size)))


def reflections_of(basis, bits):
    """Whole numbers that stand for an orthonormal basis.

    Parameters
    ----------
    basis : (m, r) float
        Orthonormal columns.
    bits : int
        Of each number, 6 to 16.

    Returns
    -------
    numbers : (n_reflection_numbers(m, r),) int16
        From -(2^(bits - 1) - 1) on.
    signs : (r,) bool
        Columns that come out turned round.
    """
    rest = np.array(basis, np.float64)
    size, n_columns = rest.shape
    most = _most(bits)
    numbers, signs = [], np.zeros(n_columns, bool)
    for j in range(n_columns):
        column = rest[j:, j]
        # The sign that keeps every number of the reflection below 1.
        signs[j] = column[0] > 0
        length = np.linalg.norm(column)
        head = column[0] + (length if signs[j] else -length)
        number = np.rint(column[1:] / head * most)
        numbers.append(number.astype(np.int16))
        # Later reflections make up for the rounding of this one.
        _reflect(rest[j:, j:], number / most)
    return np.concatenate(numbers), signs


def basis_of(numbers, signs, size, bits):
    """The basis that numbers and signs of `reflections_of` stand for.

    Parameters
    ----------
    numbers : (n_reflection_numbers(size, r),) int16
    signs : (r,) bool
    size : int
        Rows m of the basis.
    bits : int

    Returns
    -------
    (m, r) float32
    """
    n_columns, most = len(signs), _most(bits)
    basis = np.eye(size, n_columns)
    basis[:, signs] *= -1
    ends = np.cumsum([size - 1 - j for j in range(n_columns)])
    for j in reversed(range(n_columns)):
        tail = numbers[ends[j] - (size - 1 - j) : ends[j]] / most
        _reflect(basis[j:, j:], tail)
    return basis.astype(np.float32)


def _reflect(matrix, tail):
    """Reflect columns across what is at right angles to (1, tail), in place."""
    vector = np.concatenate([[1.0], tail])
    matrix -= np.outer(2 / (vector @ vector) * vector, vector @ matrix)


def _most(bits):
    return (1 << expect_whole("bits", bits, LEAST_BITS, MOST_BITS) - 1) - 1
