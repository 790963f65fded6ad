"""Spherical harmonics on HRDFs, by least squares on the hemisphere (Sloan et al. 2003)."""

import numpy as np

from prt_core.basis import harmonics
from prt_core.compress.state import array_of, expect_state
from prt_core.lightfield.atoms import AtomCompressor
from prt_core.lightfield.hrdf import MOST, HRDFLayout

# Degrees 0 to 15.
_ORDER = 16


class HRDFHarmonics(AtomCompressor):
    """HRDFs as the harmonics of lowest degree, all with as many.

    On half of the sphere harmonics are not orthogonal: they are made so one after the other, so
    that the first n coefficients are those of least squares with the first n harmonics.

    Parameters
    ----------
    n_coefficients : int, optional
        At most; of degree l there are 2 l + 1. 256 at most, and one for each cell.
    threshold : float, optional
        As many as minimise the squared error plus threshold^2 for each coefficient of each HRDF.
    """

    def __init__(self, n_coefficients=None, threshold=None):
        self.n_coefficients = n_coefficients
        self.threshold = threshold

    def train_steps(self, hrdfs, labels):
        self.expect_params()
        self._set_atoms(hrdfs.shape[1:], int(labels.max()) + 1)
        yield from ()

    def _set_atoms(self, shape, n_clusters):
        directions = HRDFLayout(*shape).directions
        values = harmonics(directions, _ORDER)[:, : len(directions)]
        basis, triangle = np.linalg.qr(values)
        # Those that others make up on these cells take no part.
        diagonal = np.diag(triangle)
        basis *= np.sign(diagonal) * (np.abs(diagonal) > 1e-6 * np.abs(diagonal).max())
        self.atoms_ = [np.ascontiguousarray(basis.T, np.float32)] * n_clusters
        self.means_ = np.zeros((n_clusters, len(directions)), np.float32)

    def encode_steps(self, hrdfs, labels):
        count = len(self.atoms_[0])
        if self.n_coefficients is not None:
            count = min(count, self.n_coefficients)
        if self.threshold is not None:
            flat = hrdfs.reshape(len(hrdfs), -1)
            energies = np.square(flat @ self.atoms_[0][:count].T, dtype=np.float64).sum(axis=0)
            cost = np.cumsum([0, *(self.threshold**2 * len(flat) - energies)])
            count = int(cost.argmin())
        self.count_ = count
        return (yield from super().encode_steps(hrdfs, labels))

    def _weights(self, rows, cluster):
        return rows @ self.atoms_[cluster][: self.count_].T

    @property
    def nbytes(self):
        self._expect_fitted()
        return self._dense_nbytes() + 8

    def _dictionary(self):
        return {}

    def _coefficients(self):
        return {"count": np.array([self.count_], np.int32), **super()._coefficients()}

    def _restore(self, state, labels):
        expect_state(max(self.shape_) <= MOST, "its tables are too large")
        self._set_atoms(self.shape_, int(labels.max()) + 1)
        count = array_of(state, "count", (1,), "int32", len(self.atoms_[0]) + 1)
        self.count_ = int(count[0])
        self._restore_rows(state, labels)
