"""Two-dimensional Haar wavelets on HRDFs."""

import numpy as np

from prt_core.lightfield.rivals.fixed_pairs import FixedPair


class Haar2D(FixedPair):
    """HRDFs in products of Haar wavelets of rows and of columns (the standard decomposition)."""

    @staticmethod
    def _basis(size):
        return haar_basis(size)


def haar_basis(size):
    """(size, size) float64: Haar's wavelets as columns, the coarse ones first.

    A `size` of 2^k m is halved k times; m pieces remain, as in `haar_forward`.
    """
    levels = (size & -size).bit_length() - 1
    n_coarse = size >> levels
    length = size // n_coarse
    columns = [np.kron(np.eye(n_coarse), np.ones((length, 1))) / np.sqrt(length)]
    for level in range(levels):
        length = size // (n_coarse << level)
        wavelet = np.repeat([1.0, -1.0], length // 2)[:, None] / np.sqrt(length)
        columns.append(np.kron(np.eye(n_coarse << level), wavelet))
    return np.concatenate(columns, axis=1)
