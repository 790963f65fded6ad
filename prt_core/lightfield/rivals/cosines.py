"""Two-dimensional cosines (DCT-II) on HRDFs."""

import numpy as np
from scipy.fft import idct

from prt_core.lightfield.rivals.fixed_pairs import FixedPair


class Cosines2D(FixedPair):
    """HRDFs in products of cosines of rows and of columns (Ahmed et al. 1974)."""

    @staticmethod
    def _basis(size):
        return idct(np.eye(size), axis=0, norm="ortho")
