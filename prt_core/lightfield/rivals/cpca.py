"""Clustered principal components of HRDFs (Sloan et al. 2003; Miandji et al. 2011)."""

import numpy as np

from prt_core.compress.linalg import principal_rows
from prt_core.errors import expect_whole
from prt_core.lightfield.atoms import AtomCompressor
from prt_core.lightfield.kept_rows import KeptRows
from prt_core.runtime.main_thread import in_thread


class CPCA(AtomCompressor):
    """HRDFs about the mean of their cluster, in its strongest components.

    Components come from block power iteration, or from the smaller of the two Gram matrices: a
    cluster may have fewer HRDFs than an HRDF has cells (`principal_rows`).

    Parameters
    ----------
    n_coefficients : int, optional
        Components of each cluster, at most.
    threshold : float, optional
        A cluster has those components each number of which, weights and the component's own,
        saves more than threshold^2 of squared error.
    bits : int
        Of each number of means and components, 8 to 16.
    """

    def __init__(self, n_coefficients=None, threshold=None, bits=12):
        self.n_coefficients = n_coefficients
        self.threshold = threshold
        self.bits = bits

    def expect_params(self):
        self.sparsity()
        expect_whole("bits", self.bits, 8, 16)
        return self

    def train_steps(self, hrdfs, labels):
        self.expect_params()
        n_cells, self._trained, self._energies, self._sizes = hrdfs[0].size, [], [], []
        for cluster in range(int(labels.max()) + 1):
            rows = hrdfs[labels == cluster].reshape(-1, n_cells)
            mean = rows.mean(axis=0, dtype=np.float64).astype(np.float32)
            most = n_cells if self.n_coefficients is None else self.n_coefficients
            basis, energies = yield from in_thread(
                "principal components", principal_rows, rows - mean, most
            )
            self._trained.append(np.concatenate([mean[None], basis]))
            self._energies.append(energies)
            self._sizes.append(len(rows))

    def encode_steps(self, hrdfs, labels):
        cut = [rows[: 1 + rank] for rows, rank in zip(self._trained, self._ranks(), strict=True)]
        self._set_atoms(KeptRows.of(cut, self.bits))
        return (yield from super().encode_steps(hrdfs, labels))

    def _ranks(self):
        for energies, size, rows in zip(self._energies, self._sizes, self._trained, strict=True):
            rank = len(energies)
            if self.n_coefficients is not None:
                rank = min(rank, self.n_coefficients)
            if self.threshold is not None:
                price = self.threshold**2 * (size + rows.shape[1])
                rank = min(rank, int((energies > price).sum()))
            yield rank

    def _set_atoms(self, kept):
        self._kept = kept
        self.atoms_ = [rows[1:] for rows in kept.values]
        self.means_ = np.stack([rows[0] for rows in kept.values])

    def _weights(self, rows, cluster):
        return rows @ self.atoms_[cluster].T

    @property
    def nbytes(self):
        self._expect_fitted()
        return self._kept.nbytes + self._dense_nbytes() + 8

    def _dictionary(self):
        return self._kept.arrays()

    def _restore(self, state, labels):
        n_cells = self.shape_[0] * self.shape_[1]
        kept = KeptRows.from_state(state, int(labels.max()) + 1, n_cells, self.bits)
        self._set_atoms(kept)
        self._restore_rows(state, labels)
