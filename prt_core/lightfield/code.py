"""Sparse whole numbers as bytes: at fixed width, and with what is likely taking less.

Each row (an HRDF in one channel) has a few numbers at places of a table, in a basis that is known.
Both codes are exact. At fixed width a row can be read by itself, as a renderer does: a head, then a
place and a number of so many bits each. Entropy-coded, what is alike stands together: for each
basis and place, over all points in their order, whether there is a number; then the numbers'
exponents, signs and lower bits in that order, each plane a zstd frame.
"""

from dataclasses import dataclass

import numpy as np
from numcodecs import Zstd

from prt_core.compress.state import array_of, expect_state

_LEVEL = 19
# Values whose bits are spread out at once.
_VALUES = 1 << 20
# Bits that say how many bits a row's numbers have.
_WIDTH_BITS = 5
# Numbers are below 2^30, and so are their exponents below 30.
MOST = 1 << 30


@dataclass
class SparseRows:
    """Rows of whole numbers, most of them 0.

    Attributes
    ----------
    basis : (n,) int32
        Which basis a row is in.
    starts : (n + 1,) int64
        Where a row's numbers begin and end.
    places : (n_numbers,) int32
        In the row's table, ascending in each row.
    numbers : (n_numbers,) int32
        None is 0; less than 2^30 in size.
    """

    basis: np.ndarray
    starts: np.ndarray
    places: np.ndarray
    numbers: np.ndarray

    @classmethod
    def of_table(cls, basis, table):
        """The rows of a dense `table` (n, n_places) int32, each in its `basis` (n,) int32."""
        rows, places = np.nonzero(table)
        starts = np.searchsorted(rows, np.arange(len(table) + 1)).astype(np.int64)
        return cls(basis, starts, places.astype(np.int32), table[rows, places].astype(np.int32))

    @property
    def counts(self):
        """(n,) int64 numbers of each row."""
        return np.diff(self.starts)

    @property
    def rows(self):
        """(n_numbers,) int64 row of each number."""
        return np.repeat(np.arange(len(self.basis)), self.counts)

    def values(self, step):
        """(n_numbers,) float32: the numbers in multiples of `step`."""
        return self.numbers.astype(np.float32) * np.float32(step)

    def some(self, rows):
        """`SparseRows` of the rows with the indices `rows` (m,) int."""
        counts = self.counts[rows]
        starts = np.concatenate([[0], np.cumsum(counts)])
        inside = np.arange(starts[-1]) - np.repeat(starts[:-1], counts)
        here = np.repeat(self.starts[rows], counts) + inside
        return SparseRows(self.basis[rows], starts, self.places[here], self.numbers[here])


def fixed_width(rows, n_places):
    """The bytes of rows at fixed width.

    Parameters
    ----------
    rows : SparseRows
    n_places : int
        What places are below.

    Returns
    -------
    (n_bytes,) uint8
        The count of each row and how many bits its numbers have, column after column; then each
        number's place and the number, its sign in the lowest bit.
    """
    counts = rows.counts
    folded = _folded(rows.numbers)
    widths = np.zeros(len(counts), np.int64)
    np.maximum.at(widths, rows.rows, _bit_length(folded))
    most = bits_for(int(counts.max(initial=0)) + 1)
    head = [_bits(counts, most), _bits(widths, _WIDTH_BITS)]
    each = np.repeat(widths, counts)
    place_bits = bits_for(n_places)
    body = []
    for first in range(0, len(folded), _VALUES):
        part = slice(first, first + _VALUES)
        together = rows.places[part].astype(np.int64) << each[part] | folded[part]
        body.append(_bits(together, each[part] + place_bits))
    return np.packbits(np.concatenate(head + body))


def from_fixed_width(data, basis, most, n_places):
    """Undo `fixed_width`.

    Parameters
    ----------
    data : (n_bytes,) uint8
    basis : (n,) int32
        Of each row.
    most : int
        Numbers of the fullest row.
    n_places : int

    Returns
    -------
    SparseRows
    """
    bits = np.unpackbits(data)
    n_rows, columns, first = len(basis), [], 0
    for width in (bits_for(most + 1), _WIDTH_BITS):
        columns.append(_whole(bits[first : first + n_rows * width], np.full(n_rows, width)))
        first += n_rows * width
    counts, widths = columns
    each = np.repeat(widths, counts)
    place_bits = bits_for(n_places)
    together = _whole(bits[first:], each + place_bits)
    numbers = _unfolded(together & (np.int64(1) << each) - 1)
    places = (together >> each).astype(np.int32)
    starts = np.concatenate([[0], np.cumsum(counts)])
    return SparseRows(basis, starts, places, numbers)


def entropy_coded(rows, n_bases, n_places):
    """The planes of rows, each as a zstd frame.

    Parameters
    ----------
    rows : SparseRows
    n_bases, n_places : int

    Returns
    -------
    dict of str to (n_bytes,) uint8
    """
    kept, numbers = [], []
    order = np.argsort(rows.basis, kind="stable")
    for members in np.split(order, np.searchsorted(rows.basis[order], np.arange(1, n_bases))):
        part = rows.some(members)
        table = np.zeros((n_places, len(members)), np.int32)
        table[part.places, part.rows] = part.numbers
        kept.append(np.packbits(table != 0))
        numbers.append(table[table != 0])
    numbers = np.concatenate(numbers)
    sizes = np.abs(numbers)
    exponents = _bit_length(sizes) - 1
    low = [
        np.packbits((sizes[exponents > bit] >> bit & 1).astype(bool))
        for bit in range(int(exponents.max(initial=0)))
    ]
    planes = {
        "kept": np.concatenate(kept),
        "exponents": exponents.astype(np.uint8),
        "signs": np.packbits(numbers < 0),
        "low_bits": np.concatenate(low) if low else np.zeros(0, np.uint8),
    }
    return {name: compressed(plane) for name, plane in planes.items()}


def from_entropy_coded(state, basis, n_bases, n_places):
    """Undo `entropy_coded`.

    Parameters
    ----------
    state : dict of str to (n_bytes,) uint8
    basis : (n,) int32
        Of each row, below `n_bases`.
    n_bases, n_places : int

    Returns
    -------
    SparseRows

    Raises
    ------
    PRTError
        A plane is missing, or does not fit the rest.
    """
    order = np.argsort(basis, kind="stable")
    groups = np.split(order, np.searchsorted(basis[order], np.arange(1, n_bases)))
    kept = decompressed(state, "kept", sum(-(-len(g) * n_places // 8) for g in groups))
    rows_of, places_of, first = [], [], 0
    for members in groups:
        n_bytes = -(-len(members) * n_places // 8)
        bits = np.unpackbits(kept[first : first + n_bytes], count=len(members) * n_places)
        first += n_bytes
        places, rows = np.nonzero(bits.reshape(n_places, -1))
        rows_of.append(members[rows])
        places_of.append(places)
    rows, places = np.concatenate(rows_of), np.concatenate(places_of)
    numbers = _numbers_of(state, len(rows))
    # Stable, and places of a basis came in ascending order.
    order = np.argsort(rows, kind="stable")
    starts = np.searchsorted(rows[order], np.arange(len(basis) + 1)).astype(np.int64)
    return SparseRows(basis, starts, places[order].astype(np.int32), numbers[order])


def _numbers_of(state, count):
    exponents = decompressed(state, "exponents", count).astype(np.int64)
    expect_state(not count or exponents.max() < 30, "its numbers are too large")
    highest = int(exponents.max(initial=0))
    counts = [int((exponents > bit).sum()) for bit in range(highest)]
    low = decompressed(state, "low_bits", sum(-(-n // 8) for n in counts))
    sizes, first = np.int64(1) << exponents, 0
    for bit, n in enumerate(counts):
        n_bytes = -(-n // 8)
        bits = np.unpackbits(low[first : first + n_bytes], count=n).astype(np.int64)
        sizes[exponents > bit] |= bits << bit
        first += n_bytes
    signs = np.unpackbits(decompressed(state, "signs", -(-count // 8)), count=count)
    return np.where(signs, -sizes, sizes).astype(np.int32)


def compressed(plane):
    """A zstd frame, (n_bytes,) uint8, of a `plane` (n,) uint8; nothing of nothing."""
    if not len(plane):
        return np.zeros(0, np.uint8)
    return np.frombuffer(Zstd(_LEVEL).encode(np.ascontiguousarray(plane)), np.uint8)


def decompressed(state, name, n_bytes):
    """The plane `name` of a `state`, (n_bytes,) uint8; `PRTError` where it is not as long."""
    frame = array_of(state, name, (None,), "uint8")
    if not n_bytes and not len(frame):
        return np.zeros(0, np.uint8)
    out = np.empty(n_bytes, np.uint8)
    try:
        # Into so many bytes and no more, whatever the frame says of itself.
        length = len(Zstd(_LEVEL).decode(frame, out))
    except (RuntimeError, ValueError):
        length = -1
    expect_state(length == n_bytes, f"'{name}' does not hold {n_bytes} bytes")
    return out


def byte_planes(values):
    """A zstd frame, (n_bytes,) uint8, of `values` (...) of two bytes each, the low ones first."""
    return compressed(np.ascontiguousarray(values).view(np.uint8).reshape(-1, 2).T.ravel())


def from_byte_planes(state, name, shape, dtype):
    """Undo `byte_planes`: the array `name` of a `state`, of a `shape` and `dtype` of two bytes.

    Returns
    -------
    (...) of that shape
    """
    count = int(np.prod(shape))
    planes = decompressed(state, name, 2 * count).reshape(2, -1)
    return np.ascontiguousarray(planes.T).view(dtype).reshape(shape)


def bits_for(count):
    """Bits that tell `count` things apart."""
    return max(int(count) - 1, 0).bit_length()


def pack(numbers, bits):
    """(n_bytes,) uint8 of `numbers` (n,) int, each in `bits` bits, two's complement."""
    return np.packbits(_bits(np.asarray(numbers, np.int64) & (1 << bits) - 1, bits))


def unpack(data, count, bits):
    """(count,) int64: undo `pack` of so many numbers in so many `bits` from `data` (n,) uint8."""
    numbers = _whole(np.unpackbits(data, count=count * bits), np.full(count, bits))
    return np.where(numbers >> bits - 1, numbers - (1 << bits), numbers)


def _folded(numbers):
    """Whole numbers with their sign in the lowest bit: 0, -1, 1, -2, ... as 0, 1, 2, 3, ..."""
    numbers = numbers.astype(np.int64)
    return np.where(numbers < 0, -2 * numbers - 1, 2 * numbers)


def _unfolded(folded):
    return np.where(folded & 1, -(folded + 1) // 2, folded // 2).astype(np.int32)


def _bit_length(numbers):
    """(n,) int64: bits of whole numbers, 0 for 0."""
    return np.frexp(numbers.astype(np.float64))[1].astype(np.int64)


def _bits(numbers, widths):
    """The bits of numbers, each in so many, the highest first: uint8 of 0 and 1."""
    numbers = np.asarray(numbers, np.int64)
    widths = np.broadcast_to(widths, numbers.shape)
    ends = np.cumsum(widths)
    below = np.repeat(ends, widths) - 1 - np.arange(ends[-1] if len(ends) else 0)
    return (np.repeat(numbers, widths) >> below & 1).astype(np.uint8)


def _whole(bits, widths):
    """Numbers of so many bits each: undo `_bits`."""
    ends = np.cumsum(widths)
    total = int(ends[-1]) if len(ends) else 0
    numbers = np.zeros(len(widths), np.int64)
    below = np.repeat(ends, widths) - 1 - np.arange(total)
    which = np.repeat(np.arange(len(widths)), widths)
    np.add.at(numbers, which, bits[:total].astype(np.int64) << below)
    return numbers
