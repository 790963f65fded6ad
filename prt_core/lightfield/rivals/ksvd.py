"""K-SVD of HRDFs: sums of few atoms out of many (Bryt and Elad 2008)."""

import numpy as np

from prt_core.compress.dictionaries.ksvd import ksvd_steps
from prt_core.compress.dictionaries.omp import orthogonal_matching_pursuit
from prt_core.errors import expect_number, expect_seed, expect_whole
from prt_core.lightfield.atoms import AtomCompressor
from prt_core.lightfield.clustering import spread_subset
from prt_core.lightfield.kept_rows import KeptRows

_N_TRAINING = 16


class KSVD(AtomCompressor):
    """HRDFs as sums of few atoms, found by orthogonal matching pursuit.

    Parameters
    ----------
    n_coefficients : int, optional
        At most so many an HRDF.
    threshold : float, optional
        One for the whole object: an atom is taken while it lowers the squared error by more than
        threshold^2.
    n_atoms : int
        Of each cluster.
    share : float
        Of each cluster's HRDFs that train, drawn by k-means++.
    bits : int
        Of each number of the dictionary, 6 to 16.
    seed : int
    """

    def __init__(self, n_coefficients=None, threshold=None, n_atoms=64, share=0.8, bits=10, seed=0):
        self.n_coefficients = n_coefficients
        self.threshold = threshold
        self.n_atoms = n_atoms
        self.share = share
        self.bits = bits
        self.seed = seed

    def expect_params(self):
        self.sparsity()
        expect_whole("n_atoms", self.n_atoms, 1, 1 << 14)
        expect_number("share", self.share, above=0, most=1)
        expect_whole("bits", self.bits, 6, 16)
        expect_seed(self.seed)
        return self

    def for_chroma(self):
        return super().for_chroma().set_params(n_atoms=-(-self.n_atoms // 4))

    def halved(self):
        return self.clone().set_params(n_atoms=self.n_atoms // 2) if self.n_atoms > 1 else None

    def train_steps(self, hrdfs, labels):
        self.expect_params()
        count = self.n_coefficients or _N_TRAINING
        dictionaries = []
        for cluster in range(int(labels.max()) + 1):
            members = hrdfs[labels == cluster]
            members = members[spread_subset(members, self.share, self.seed)]
            flat = members.reshape(len(members), -1)
            atoms = yield from ksvd_steps(flat, self.n_atoms, count, seed=self.seed)
            dictionaries.append(atoms)
        self._set_atoms(KeptRows.of(dictionaries, self.bits), hrdfs[0].size)

    def _set_atoms(self, kept, n_cells):
        self._kept = kept
        self.atoms_ = [_unit(atoms) for atoms in kept.values]
        self.means_ = np.zeros((len(self.atoms_), n_cells), np.float32)

    def _weights(self, rows, cluster):
        return orthogonal_matching_pursuit(rows, self.atoms_[cluster], self.sparsity())

    @property
    def nbytes(self):
        self._expect_fitted()
        return self._kept.nbytes + self._sparse_nbytes() + 8

    def _dictionary(self):
        return self._kept.arrays()

    def _restore(self, state, labels):
        n_cells = self.shape_[0] * self.shape_[1]
        kept = KeptRows.from_state(state, int(labels.max()) + 1, n_cells, self.bits)
        self._set_atoms(kept, n_cells)
        self._restore_rows(state, labels)


def _unit(atoms):
    """Atoms of length 1, of those that were rounded; one of zeros stays."""
    lengths = np.linalg.norm(atoms, axis=1, keepdims=True)
    return atoms / np.where(lengths > 0, lengths, 1)
