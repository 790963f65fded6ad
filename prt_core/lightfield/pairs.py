"""HRDFs as sparse coefficients between two orthonormal bases: H = U S V^T.

What is common to learned pairs (CEOB) and to fixed ones (Haar, cosines): the testing phase of
Miandji et al. 2013, section 4, which writes each HRDF in the pair of its cluster that needs least,
and their equation 4, which reads single elements.
"""

from abc import abstractmethod

import numpy as np

from prt_core.compress.dictionaries.exemplar import coefficients_of
from prt_core.compress.dictionaries.reflections import (
    basis_of,
    n_reflection_numbers,
    reflections_of,
)
from prt_core.compress.state import array_of, expect_state
from prt_core.lightfield.code import (
    SparseRows,
    bits_for,
    byte_planes,
    entropy_coded,
    fixed_width,
    from_byte_planes,
    from_entropy_coded,
    pack,
    unpack,
)
from prt_core.lightfield.compressor import HRDFCompressor, rounded
from prt_core.lightfield.pair_products import PairProducts
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress

_BLOCK = 512


class PairCompressor(HRDFCompressor):
    """HRDFs in one of several pairs of orthonormal bases each.

    Attributes
    ----------
    left_ : (n_bases, m1, m1) float32
    right_ : (n_bases, m2, m2) float32
        Columns are basis vectors, the most used ones first.
    first_ : (n_clusters + 1,) int64
        Where the pairs of each cluster begin.
    rows_ : SparseRows
        S of each HRDF in multiples of `step_`, and its pair.
    """

    @abstractmethod
    def _read_pairs(self, state):
        """Set `left_`, `right_` and `first_` from a `state`."""

    @property
    @abstractmethod
    def _dictionary_bits(self):
        """Bits of the dictionary at fixed width."""

    def encode_steps(self, hrdfs, labels):
        sparsity = self.sparsity()
        self.n_points_, self.shape_ = len(hrdfs), hrdfs.shape[1:]
        order = np.argsort(labels, kind="stable")
        blocks = [
            (c, members[first : first + _BLOCK])
            for c, members in _groups(order, labels)
            for first in range(0, len(members), _BLOCK)
        ]

        def encode(block):
            cluster, members = block
            pairs = range(*self._pairs_of(cluster))
            return members, self._best(hrdfs[members], pairs, sparsity)

        basis = np.zeros(self.n_points_, np.int32)
        rows, places, values, left_out, done = [], [], [], 0.0, 0
        for members, (best, table, error) in in_parallel(encode, blocks):
            basis[members] = best
            row, place = np.nonzero(table)
            rows.append(members[row])
            places.append(place.astype(np.int32))
            values.append(table[row, place])
            left_out += error
            done += len(members)
            yield Progress("coefficients", done, self.n_points_)
        values = np.concatenate(values)
        peak = float(np.abs(values).max(initial=0))
        self.step_ = self._step(left_out, len(values), peak)
        numbers = rounded(values, self.step_)
        rows, places = np.concatenate(rows), np.concatenate(places)
        kept = np.flatnonzero(numbers)
        kept = kept[np.argsort(rows[kept], kind="stable")]
        starts = np.searchsorted(rows[kept], np.arange(self.n_points_ + 1)).astype(np.int64)
        self.rows_ = SparseRows(basis, starts, places[kept], numbers[kept])
        self._products = None
        return self

    def _best(self, hrdfs, pairs, sparsity):
        """The best pair of each HRDF, its coefficients there, and the squared error of all."""
        least = np.full(len(hrdfs), np.inf)
        best = np.zeros(len(hrdfs), np.int32)
        table = np.zeros((len(hrdfs), hrdfs[0].size), np.float32)
        for a in pairs:
            rows = coefficients_of(hrdfs, (self.left_[a], self.right_[a]))
            rows = rows.reshape(len(hrdfs), -1)
            kept = sparsity.kept(rows)
            cost = sparsity.cost(rows, kept)
            better = cost < least
            least[better], best[better] = cost[better], a
            table[better] = np.where(kept[better], rows[better], 0)
        energy = np.square(hrdfs, dtype=np.float64).sum()
        return best, table, max(energy - np.square(table, dtype=np.float64).sum(), 0.0)

    def _pairs_of(self, cluster):
        return int(self.first_[cluster]), int(self.first_[cluster + 1])

    def decode(self, points):
        points = self._points(points)
        m1, m2 = self.shape_
        result = np.empty((len(points), m1, m2), np.float32)
        order = np.argsort(self.rows_.basis[points], kind="stable")

        def decode(block):
            a, where = block
            part = self.rows_.some(points[where])
            table = np.zeros((len(where), m1 * m2), np.float32)
            table[part.rows, part.places] = part.values(self.step_)
            half = table.reshape(-1, m1, m2) @ self.right_[a].T
            np.matmul(self.left_[a], half, out=half)
            result[where] = half

        blocks = [
            (a, where[first : first + _BLOCK])
            for a, where in _groups(order, self.rows_.basis[points])
            for first in range(0, len(where), _BLOCK)
        ]
        for _ in in_parallel(decode, blocks):
            pass
        return result

    def _entries(self, points, cells):
        part, m2 = self.rows_.some(points), self.shape_[1]
        row, column = np.divmod(cells, m2)
        i, j = np.divmod(part.places, m2)
        which = part.rows
        basis = part.basis[which]
        terms = self.left_[basis, row[which], i] * self.right_[basis, column[which], j]
        terms *= part.values(self.step_)
        return np.bincount(which, terms, len(points)).astype(np.float32)

    def interpolated(self, row, column):
        self._expect_fitted()
        if self._products is None:
            self._products = PairProducts(self.left_, self.right_, self.rows_, self.step_)
        return self._products.interpolated(row, column)

    @property
    def n_numbers_(self):
        self._expect_fitted()
        return len(self.rows_.numbers)

    @property
    def nbytes(self):
        self._expect_fitted()
        widest = int(np.diff(self.first_).max())
        pairs = -(-self.n_points_ * bits_for(widest) // 8)
        n_places = self.shape_[0] * self.shape_[1]
        return -(-self._dictionary_bits // 8) + pairs + len(fixed_width(self.rows_, n_places)) + 8

    def _coefficients(self):
        clusters = np.searchsorted(self.first_, self.rows_.basis, "right") - 1
        local = self.rows_.basis - self.first_[clusters]
        pair = byte_planes(local.astype("<u2"))
        n_places = self.shape_[0] * self.shape_[1]
        return {"pair": pair, **entropy_coded(self.rows_, len(self.left_), n_places)}

    def _restore(self, state, labels):
        self._read_pairs(state)
        counts = np.diff(self.first_)
        expect_state(labels.max() < len(counts), "its pairs do not fit its clusters")
        local = from_byte_planes(state, "pair", (self.n_points_,), "<u2").astype(np.int32)
        expect_state((local < counts[labels]).all(), "it names a pair that its cluster has not")
        basis = (self.first_[labels] + local).astype(np.int32)
        n_places = self.shape_[0] * self.shape_[1]
        self.rows_ = from_entropy_coded(state, basis, len(self.left_), n_places)
        self._products = None


def _groups(order, labels):
    """(label, members) of indices `order` that are sorted by their labels."""
    sorted_labels = labels[order]
    starts = np.flatnonzero(np.diff(sorted_labels, prepend=-1))
    for members in np.split(order, starts[1:]) if len(order) else []:
        yield int(labels[members[0]]), members


class LearnedPairs(PairCompressor):
    """Pairs that are kept: as reflections, of the columns that are in use.

    Attributes
    ----------
    used_ : (n_bases, 2) int64
        Columns of each basis that some coefficient uses.
    bits : int
        Of each number of the reflections: a parameter of the subclass.
    """

    def _round_pairs(self, pairs):
        """Set `left_` and `right_` to what the bits leave of `pairs`, for encoding in them."""
        self._reflections = [
            [reflections_of(basis, self.bits) for basis in side]
            for side in zip(*pairs, strict=True)
        ]
        self.left_, self.right_ = (
            np.stack([self._basis(*reflections, size) for reflections in side])
            for side, size in zip(self._reflections, self.shape_, strict=True)
        )

    @property
    def used_(self):
        """(n_bases, 2) int64: columns of the left and right bases up to the last one in use."""
        i, j = np.divmod(self.rows_.places, self.shape_[1])
        basis = self.rows_.basis[self.rows_.rows]
        used = np.zeros((len(self.left_), 2), np.int64)
        np.maximum.at(used[:, 0], basis, i + 1)
        np.maximum.at(used[:, 1], basis, j + 1)
        return used

    @property
    def _dictionary_bits(self):
        numbers = sum(
            n_reflection_numbers(size, count)
            for counts in self.used_
            for size, count in zip(self.shape_, counts, strict=True)
        )
        counted = sum(bits_for(size + 1) for size in self.shape_) * len(self.left_)
        return numbers * self.bits + int(self.used_.sum()) + counted

    def _dictionary(self):
        used, numbers, signs = self.used_, [], []
        for side, counts, size in zip(self._reflections, used.T, self.shape_, strict=True):
            for (tails, turned), count in zip(side, counts, strict=True):
                numbers.append(tails[: n_reflection_numbers(size, count)])
                signs.append(turned[:count])
        return {
            "used": used.astype(np.int16),
            "first": self.first_.astype(np.int32),
            "reflections": pack(np.concatenate(numbers), self.bits),
            "turned": np.packbits(np.concatenate(signs)),
        }

    def _read_pairs(self, state):
        used = array_of(state, "used", (None, 2), "int16", max(self.shape_) + 1).astype(np.int64)
        expect_state((used <= self.shape_).all(), "its bases do not fit its tables")
        first = array_of(state, "first", (None,), "int32", len(used) + 1).astype(np.int64)
        rising = len(first) > 1 and first[0] == 0 and first[-1] == len(used)
        expect_state(rising and (np.diff(first) > 0).all(), "its pairs do not fit its clusters")
        self.first_ = first
        sizes = [
            [n_reflection_numbers(size, count) for count in counts]
            for size, counts in zip(self.shape_, used.T, strict=True)
        ]
        n_numbers, n_signs = sum(map(sum, sizes)), int(used.sum())
        data = array_of(state, "reflections", (-(-n_numbers * self.bits // 8),), "uint8")
        numbers = unpack(data, n_numbers, self.bits)
        data = array_of(state, "turned", (-(-n_signs // 8),), "uint8")
        signs = np.unpackbits(data, count=n_signs).astype(bool)
        self._reflections, at, turned = [], 0, 0
        for lengths, counts in zip(sizes, used.T, strict=True):
            side = []
            for length, count in zip(lengths, counts, strict=True):
                side.append((numbers[at : at + length], signs[turned : turned + count]))
                at, turned = at + length, turned + count
            self._reflections.append(side)
        self.left_, self.right_ = (
            np.stack([self._basis(*reflections, size) for reflections in side])
            for side, size in zip(self._reflections, self.shape_, strict=True)
        )

    def _basis(self, numbers, signs, size):
        """(size, size) float32: columns beyond those that are kept are zeros."""
        basis = np.zeros((size, size), np.float32)
        basis[:, : len(signs)] = basis_of(numbers, signs, size, self.bits)
        return basis
