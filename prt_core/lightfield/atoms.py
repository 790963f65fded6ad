"""HRDFs as sums of atoms, each a whole HRDF: what K-SVD, clustered PCA and harmonics share.

    H_i(alpha) = mean_c(alpha) + sum_j w_ij atom_cj(alpha)                                  (3)

of Miandji et al. 2013.
"""

from abc import abstractmethod

import numpy as np
from scipy.sparse import csr_array

from prt_core.lightfield.code import (
    SparseRows,
    bits_for,
    entropy_coded,
    fixed_width,
    from_entropy_coded,
)
from prt_core.lightfield.compressor import HRDFCompressor, rounded
from prt_core.lightfield.hrdf import bilinear_weights, split_places
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress
from prt_core.runtime.threads import on_all_cores

_BLOCK = 1024


class AtomCompressor(HRDFCompressor):
    """HRDFs as sums of atoms of their cluster.

    A subclass trains, sets `atoms_` and `means_`, and gives `_weights`.

    Attributes
    ----------
    atoms_ : list of (k, n_cells) float32
        Of each cluster.
    means_ : (n_clusters, n_cells) float32
    rows_ : SparseRows
        Weights of each HRDF in multiples of `step_`; its basis is its cluster.
    """

    @abstractmethod
    def _weights(self, rows, cluster):
        """(n, k) float32: weights of (n, n_cells) HRDFs less the mean, 0 where none is kept."""

    def encode_steps(self, hrdfs, labels):
        self.n_points_, self.shape_ = len(hrdfs), hrdfs.shape[1:]
        flat = hrdfs.reshape(len(hrdfs), -1)
        blocks = [
            (cluster, members[first : first + _BLOCK])
            for cluster in range(len(self.atoms_))
            for members in [np.flatnonzero(labels == cluster)]
            for first in range(0, len(members), _BLOCK)
        ]

        def encode(block):
            cluster, members = block
            rows = flat[members] - self.means_[cluster]
            weights = self._weights(rows, cluster)
            atoms = self.atoms_[cluster][: weights.shape[1]]
            error = np.square(rows - weights @ atoms, dtype=np.float64).sum()
            row, place = np.nonzero(weights)
            return members[row], place.astype(np.int32), weights[row, place], error

        parts, done = [], 0
        for block, part in zip(blocks, in_parallel(encode, blocks), strict=True):
            parts.append(part)
            done += len(block[1])
            yield Progress("coefficients", done, self.n_points_)
        rows, places, values, errors = zip(*parts, strict=True)
        rows, places, values = (np.concatenate(part) for part in (rows, places, values))
        self.step_ = self._step(sum(errors), len(values), float(np.abs(values).max(initial=0)))
        numbers = rounded(values, self.step_)
        kept = np.flatnonzero(numbers)
        kept = kept[np.argsort(rows[kept], kind="stable")]
        starts = np.searchsorted(rows[kept], np.arange(self.n_points_ + 1)).astype(np.int64)
        self.rows_ = SparseRows(labels.astype(np.int32), starts, places[kept], numbers[kept])
        return self

    def _table(self, part, n_atoms):
        """(n, n_atoms) float32: weights of `SparseRows`, dense."""
        table = np.zeros((len(part.basis), n_atoms), np.float32)
        table[part.rows, part.places] = part.values(self.step_)
        return table

    def decode(self, points):
        points = self._points(points)
        result = np.empty((len(points), self.means_.shape[1]), np.float32)
        labels = self.rows_.basis[points]
        for cluster, atoms in enumerate(self.atoms_):
            here = np.flatnonzero(labels == cluster)
            table = self._table(self.rows_.some(points[here]), len(atoms))
            result[here] = table @ atoms + self.means_[cluster]
        return result.reshape(-1, *self.shape_)

    def _entries(self, points, cells):
        part, atoms = self.rows_.some(points), np.concatenate(self.atoms_)
        first = np.cumsum([0, *(len(each) for each in self.atoms_)])
        terms = part.values(self.step_)
        terms *= atoms[first[part.basis[part.rows]] + part.places, cells[part.rows]]
        sums = np.bincount(part.rows, terms, len(points))
        return (sums + self.means_[part.basis, cells]).astype(np.float32)

    def interpolated(self, row, column):
        self._expect_fitted()
        m1, m2 = self.shape_
        row, up = split_places(np.array(row, np.float32), m1)
        column, right = split_places(np.array(column, np.float32), m2)
        weights = bilinear_weights(up, right)
        beside, below = int(m2 > 1), m2 * int(m1 > 1)
        cells = (row * m2 + column)[:, None] + np.array([0, beside, below, below + beside])
        result = np.empty(self.n_points_, np.float32)

        def between(block):
            cluster, points = block
            n, atoms = len(points), self.atoms_[cluster]
            entries = weights[points].ravel(), cells[points].ravel(), np.arange(0, 4 * n + 1, 4)
            looked_up = csr_array(entries, shape=(n, m1 * m2))
            table = self._table(self.rows_.some(points), len(atoms))
            there = looked_up @ np.ascontiguousarray(atoms.T)
            result[points] = np.einsum("nk,nk->n", table, there) + looked_up @ self.means_[cluster]

        on_all_cores(between, list(self._blocks()))
        return result

    def _blocks(self):
        for cluster in range(len(self.atoms_)):
            members = np.flatnonzero(self.rows_.basis == cluster)
            for first in range(0, len(members), _BLOCK):
                yield cluster, members[first : first + _BLOCK]

    @property
    def n_numbers_(self):
        self._expect_fitted()
        return len(self.rows_.numbers)

    @property
    def _n_places(self):
        return max(1, *(len(atoms) for atoms in self.atoms_))

    def _coefficients(self):
        return entropy_coded(self.rows_, len(self.atoms_), self._n_places)

    def _restore_rows(self, state, labels):
        clusters = len(self.atoms_), self._n_places
        self.rows_ = from_entropy_coded(state, labels.astype(np.int32), *clusters)

    def _sparse_nbytes(self):
        """Bytes of places and numbers at fixed width."""
        return len(fixed_width(self.rows_, self._n_places))

    def _dense_nbytes(self):
        """Bytes of all weights at fixed width, each component of a cluster with bits of its own."""
        bits, places = 0, self._n_places
        key = self.rows_.basis[self.rows_.rows] * places + self.rows_.places
        most = np.zeros(len(self.atoms_) * places, np.int64)
        np.maximum.at(most, key, np.abs(self.rows_.numbers))
        counts = np.bincount(self.rows_.basis, minlength=len(self.atoms_))
        for count, largest in zip(counts, most.reshape(-1, places), strict=True):
            bits += sum(5 + int(count) * bits_for(2 * int(m) + 1) for m in largest)
        return -(-bits // 8)
