"""Sparse columns in few bytes, which a product reads as they are.

Each term is one word of 12, 16 or 24 bits: its quantised value above the low bits of its place.
The high bits of a column's places are a row of bits: as many zeros as buckets are passed, a one
for each term (Elias 1974, Fano 1971). Of the three words a column takes what is shortest for it.
"""

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
import scipy.sparse as sp

from prt_core.compress.state import array_of
from prt_core.errors import expect

# A second term at a place is for what quantising the first leaves of it; they add up.
TERMS_A_PLACE = 2
_WORDS = (12, 16, 24)
# Terms that are unpacked at once.
_TERMS = 1 << 18
# Name, count and size of a column.
_HEAD = 4 + 4 + 4


def column_bytes(counts, n_rows, bits):
    """Bytes that columns of so many terms take, and the word each of them takes.

    Parameters
    ----------
    counts : (m,) int
    n_rows : int
    bits : int or None
        Of a value; None: float32, kept beside the words.

    Returns
    -------
    nbytes : (m,) int64
        0 for columns without terms: they are left out.
    words : (m,) int64
    """
    counts = np.asarray(counts, np.int64)
    words = np.array([w for w in _WORDS if w > (bits or 0)])
    low = words - (bits or 0)
    high = (counts[:, None] + _buckets(n_rows, low) + 7) // 8
    sizes = _HEAD + high + -(-counts[:, None] // 2 * 2 * words // 8)
    sizes = sizes + (4 * counts[:, None] if bits is None else 0)
    best = sizes.argmin(axis=1)
    return np.where(counts > 0, sizes[np.arange(len(counts)), best], 0), words[best]


@dataclass(frozen=True)
class SparseColumns:
    """Some columns whose terms are words of the same length.

    Attributes
    ----------
    n_rows, word : int
    bits : int or None
    names : (m,) int32
    counts : (m,) int32
    sizes : (m,) float32
        A column's values are integers times its size.
    high, low : (k,) uint8
    values : (n_terms,) float32
        Where `bits` is None, else empty.
    """

    n_rows: int
    word: int
    bits: int | None
    names: np.ndarray
    counts: np.ndarray
    sizes: np.ndarray
    high: np.ndarray
    low: np.ndarray
    values: np.ndarray

    @classmethod
    def pack(cls, n_rows, word, bits, names, sizes, places, values):
        """From lists of each column's sorted places and (integer) values."""
        counts = np.array([len(p) for p in places], np.int32)
        shift = word - (bits or 0)
        high, low = [], []
        for column, terms in zip(places, values, strict=True):
            column = column.astype(np.int64)
            passed = np.zeros(len(column) + int(_buckets(n_rows, shift)), bool)
            passed[(column >> shift) + np.arange(len(column))] = True
            high.append(np.packbits(passed))
            words = column & ((1 << shift) - 1)
            if bits is not None:
                words |= (terms.astype(np.int64) + (1 << (bits - 1))) << shift
            low.append(_to_bytes(words, word))
        kept = values if bits is None else []
        return cls(
            n_rows,
            word,
            bits,
            np.asarray(names, np.int32),
            counts,
            np.asarray(sizes, np.float32),
            np.concatenate(high),
            np.concatenate(low),
            np.concatenate([np.empty(0, np.float32), *kept]).astype(np.float32),
        )

    @property
    def nbytes(self):
        """Bytes of all arrays."""
        arrays = self.names, self.counts, self.sizes, self.high, self.low, self.values
        return sum(array.nbytes for array in arrays)

    def starts(self):
        """(m + 1,) int64 of each column's bytes in `high`, in `low`, and of its terms."""
        counts = self.counts.astype(np.int64)
        high = (counts + _buckets(self.n_rows, self.word - (self.bits or 0)) + 7) // 8
        low = -(-counts // 2) * 2 * self.word // 8
        return tuple(np.concatenate([[0], np.cumsum(n)]) for n in (high, low, counts))

    def matrix(self, columns):
        """`columns` (sorted) as (n_rows, len(columns)) CSC float32, without their sizes."""
        high_starts, low_starts, term_starts = self.starts()
        counts = self.counts[columns]
        indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        n_bytes = np.diff(high_starts)[columns]
        first_bit = 8 * (np.cumsum(n_bytes) - n_bytes)
        bits = np.unpackbits(_pieces(self.high, high_starts, columns)).view(bool)
        places = np.flatnonzero(bits).astype(np.int32)
        places -= np.repeat((first_bit - indptr[:-1]).astype(np.int32), counts)
        places -= np.arange(len(places), dtype=np.int32)
        words = _from_bytes(_pieces(self.low, low_starts, columns), self.word)
        odd = (counts & 1).astype(bool)
        if odd.any():
            # Words come in pairs; the odd one at a column's end is none.
            pairs = np.cumsum(counts + odd)
            real = np.ones(pairs[-1], bool)
            real[pairs[odd] - 1] = False
            words = words[real]
        # In the words' own type: what is narrow is quick to go through.
        shift = words.dtype.type(self.word - (self.bits or 0))
        places <<= int(shift)
        places |= (words & words.dtype.type((1 << int(shift)) - 1)).astype(np.int32)
        if self.bits is None:
            values = _pieces(self.values, term_starts, columns)
        else:
            values = (words >> shift).astype(np.float32)
            values -= np.float32(1 << (self.bits - 1))
        return sp.csc_matrix((values, places, indptr), shape=(self.n_rows, len(columns)))


_ARRAYS = {"names": "int32", "counts": "int32", "sizes": "float32", "high": "uint8",
           "low": "uint8", "values": "float32"}  # fmt: skip


def groups_state(groups):
    """Arrays of (depths, SparseColumns) pairs, joined: name -> array (see `unpack_groups`).

    Columns lie by depth, so that a depth, a word and a number tell of many.
    """
    heads = [
        (depth, packed.word, count)
        for depths, packed in groups
        for depth, count in zip(*np.unique(depths, return_counts=True), strict=True)
    ]
    state = {"groups": np.array(heads, np.int32).reshape(-1, 3)}
    for name, kind in _ARRAYS.items():
        parts = [getattr(packed, name) for _, packed in groups]
        state[name] = np.concatenate([np.empty(0, kind), *parts]).astype(kind)
    return state


def unpack_groups(state, n_rows, n_names, bits):
    """The pairs of a `groups_state`: columns of `n_rows`, with names below `n_names`.

    Raises
    ------
    PRTError
        Lengths do not fit each other, or a place is outside the rows.
    """
    groups, used = [], dict.fromkeys(_ARRAYS, 0)
    heads = array_of(state, "groups", (None, 3), "int32")
    for name, kind in _ARRAYS.items():
        array_of(state, name, (None,), kind, n_names if name == "names" else None)

    def take(name, count):
        first = used[name]
        used[name] = first + int(count)
        return state[name][first : first + int(count)]

    number = heads[:, 2]
    expect((number >= 0).all() and number.sum() == len(state["names"]), "groups: other names")
    for word, same_head in groupby(heads, key=lambda head: head[1]):
        expect(word in _WORDS and word > (bits or 0), f"word: {word} bits")
        depths = np.concatenate([np.full(count, depth) for depth, _, count in same_head])
        expect((np.diff(depths) >= 0).all(), "groups: columns do not lie by depth")
        n_columns = len(depths)
        own = {name: take(name, n_columns) for name in ("names", "counts", "sizes")}
        counts = own["counts"]
        expect(
            len(counts) == n_columns and ((counts > 0) & (counts <= TERMS_A_PLACE * n_rows)).all(),
            "counts: do not fit the rows",
        )
        empty = SparseColumns(n_rows, int(word), bits, **own, high=None, low=None, values=None)
        high, low, terms = (int(starts[-1]) for starts in empty.starts())
        packed = replace(
            empty, high=take("high", high), low=take("low", low),
            values=take("values", terms if bits is None else 0),
        )  # fmt: skip
        expect(len(packed.high) == high and len(packed.low) == low, "words: some are missing")
        for same_head in parts_of_terms(np.arange(n_columns), counts):
            matrix = packed.matrix(same_head)
            expect(
                len(matrix.indices) == counts[same_head].sum()
                and matrix.indices.min(initial=0) >= 0
                and matrix.indices.max(initial=-1) < n_rows,
                "places: some are outside the rows",
            )
        groups.append((depths, packed))
    return groups


def parts_of_terms(columns, counts):
    """Pieces of columns `some` of about 2^18 terms each, for the cache."""
    ends = np.searchsorted(np.cumsum(counts), np.arange(_TERMS, counts.sum(), _TERMS))
    return [part for part in np.split(columns, np.unique(ends)) if len(part)]


def _buckets(n_rows, shift):
    return ((n_rows - 1) >> shift) + 1


def _pieces(array, starts, columns):
    if len(columns) == len(starts) - 1:
        return array
    return np.concatenate([array[starts[i] : starts[i + 1]] for i in columns] or [array[:0]])


def _to_bytes(words, word):
    """Whole numbers below 2^word, an even number of them (a zero is added), as bytes."""
    words = np.concatenate([words, np.zeros(len(words) & 1, np.int64)])
    if word == 16:
        return words.astype("<u2").view(np.uint8)
    if word == 24:
        parts = [words & 255, words >> 8 & 255, words >> 16]
    else:
        one, two = words[0::2], words[1::2]
        parts = [one & 255, one >> 8 | (two & 15) << 4, two >> 4]
    return np.stack(parts, axis=1).astype(np.uint8).ravel()


def _from_bytes(array, word):
    if word == 16:
        return array.view("<u2")
    one, two, three = array.reshape(-1, 3).T
    if word == 24:
        return one | two.astype(np.uint32) << 8 | three.astype(np.uint32) << 16
    words = np.empty(2 * len(one), np.uint16)
    words[0::2] = one | (two & 15).astype(np.uint16) << 8
    words[1::2] = two >> 4 | three.astype(np.uint16) << 4
    return words
