"""HRDFs in one pair of bases that is known beforehand, so that none is learned or kept."""

from abc import abstractmethod

import numpy as np

from prt_core.compress.dictionaries.sparsity import Sparsity
from prt_core.compress.state import expect_state
from prt_core.lightfield.hrdf import MOST
from prt_core.lightfield.pairs import PairCompressor


class FixedPair(PairCompressor):
    """Base of compressors whose basis of m values is `_basis(m)`, whatever the HRDFs are.

    Parameters
    ----------
    n_coefficients : int, optional
        At most so many an HRDF.
    threshold : float, optional
        One for the whole object: coefficients that are not larger are left out.
    error : float, optional
        The L2 error allowed to each HRDF, instead of a threshold.
    """

    def __init__(self, n_coefficients=None, threshold=None, error=None):
        self.n_coefficients = n_coefficients
        self.threshold = threshold
        self.error = error

    def sparsity(self):
        return Sparsity(self.n_coefficients, self.threshold, self.error)

    @staticmethod
    @abstractmethod
    def _basis(size):
        """(size, size) float: orthonormal columns, those that matter most first."""

    def train_steps(self, hrdfs, labels):
        self.expect_params()
        self._set_pair(hrdfs.shape[1:])
        yield from ()

    def _set_pair(self, shape):
        self.left_, self.right_ = (self._basis(n)[None].astype(np.float32) for n in shape)
        # The same for all clusters.
        self.first_ = np.array([0, 1])

    def _pairs_of(self, cluster):
        return 0, 1

    @property
    def _dictionary_bits(self):
        return 0

    def _dictionary(self):
        return {}

    def _restore(self, state, labels):
        expect_state(max(self.shape_) <= MOST, "its tables are too large")
        self._set_pair(self.shape_)
        super()._restore(state, np.zeros_like(labels))

    def _read_pairs(self, state):
        """Nothing to read."""
