"""Sparse rows as bytes, and back."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.lightfield.code import (
    MOST,
    SparseRows,
    entropy_coded,
    fixed_width,
    from_entropy_coded,
    from_fixed_width,
    pack,
    unpack,
)
from prt_core.lightfield.planes import joined, split


def sparse_rows(n, n_places, n_bases, density=0.1, seed=1):
    rng = np.random.default_rng(seed)
    numbers = rng.integers(-3000, 3000, (n, n_places)) * (rng.random((n, n_places)) < density)
    numbers[0] = 0
    if n > 5 and n_places > 5:
        # The caustic beside all else.
        numbers[3, 2:5] = MOST - 1, 1 - MOST, 1
    return SparseRows.of_table(rng.integers(0, n_bases, n).astype(np.int32), numbers)


def same(rows, others):
    return all(
        np.array_equal(getattr(rows, name), getattr(others, name))
        for name in ("basis", "starts", "places", "numbers")
    )


@pytest.mark.parametrize("sizes", [(1, 1, 1), (77, 35, 3), (200, 512, 16), (5, 7, 2), (9, 300, 1)])
def test_both_codes_are_exact(sizes):
    n, n_places, n_bases = sizes
    rows = sparse_rows(*sizes)
    data = fixed_width(rows, n_places)
    most = int(rows.counts.max(initial=0))
    assert same(from_fixed_width(data, rows.basis, most, n_places), rows)
    # Places of so many bits, numbers of each row's own width, a count and a width a row.
    place = max(n_places - 1, 0).bit_length()
    widest = [
        max((2 * abs(v) - (v < 0)).bit_length() for v in part.tolist()) if len(part) else 0
        for part in np.split(rows.numbers, rows.starts[1:-1])
    ]
    bits = n * (most.bit_length() + 5) + int(rows.counts @ (np.array(widest) + place))
    assert len(data) == -(-bits // 8)
    planes = entropy_coded(rows, n_bases, n_places)
    assert same(from_entropy_coded(planes, rows.basis, n_bases, n_places), rows)


def test_what_is_likely_takes_less():
    rng = np.random.default_rng(0)
    # Places of a basis are nearly always the same ones, and numbers are small.
    table = np.where(rng.random((400, 64)) < 0.01, 1, 0)
    table[:, :5] = rng.integers(1, 4, (400, 5))
    rows = SparseRows.of_table(np.zeros(400, np.int32), table)
    coded = sum(plane.nbytes for plane in entropy_coded(rows, 1, 64).values())
    assert coded < 0.5 * len(fixed_width(rows, 64))


def test_rows_can_be_taken_by_themselves():
    rows = sparse_rows(40, 30, 3)
    chosen = np.array([7, 3, 3, 39])
    part = rows.some(chosen)
    for row, i in enumerate(chosen):
        here, there = (slice(r.starts[k], r.starts[k + 1]) for r, k in ((part, row), (rows, i)))
        assert np.array_equal(part.places[here], rows.places[there])
        assert np.array_equal(part.numbers[here], rows.numbers[there])
    assert np.array_equal(part.basis, rows.basis[chosen])


def test_damaged_planes_are_refused():
    rows = sparse_rows(60, 35, 2)
    planes = entropy_coded(rows, 2, 35)
    other = entropy_coded(sparse_rows(60, 35, 2, 0.4), 2, 35)
    for name, plane in planes.items():
        for wrong in (plane[:-3], np.roll(plane, 1), other[name], None, plane.astype(np.int8)):
            if name == "kept" and wrong is other[name]:
                continue
            damaged = {**planes, name: wrong}
            with pytest.raises(PRTError, match="compressed form: "):
                from_entropy_coded(damaged, rows.basis, 2, 35)


@pytest.mark.parametrize("bits", [6, 10, 13, 16])
def test_packed_numbers_come_back(bits):
    numbers = np.random.default_rng(bits).integers(1 - (1 << bits - 1), 1 << bits - 1, 37)
    data = pack(numbers, bits)
    assert len(data) == -(-37 * bits // 8)
    assert np.array_equal(unpack(data, 37, bits), numbers)


def test_many_arrays_are_one():
    arrays = {
        "a": np.arange(6, dtype=np.int16).reshape(2, 3),
        "none": np.zeros((0, 4), np.float32),
        "c": np.array([1.5, -2.5], np.float32),
    }
    data, index = joined(arrays)
    again = split({"data": data, "index": index})
    assert list(again) == list(arrays)
    for name, array in arrays.items():
        assert np.array_equal(again[name], array) and again[name].dtype == array.dtype
    for wrong in (
        {"data": data[:-1], "index": index},
        {"data": np.append(data, 0).astype(np.uint8), "index": index},
        {"data": data, "index": [["a", "object", [2]]]},
        {"data": data, "index": [["a", "int16", [-2]]]},
        {"data": data},
        {"index": index},
    ):
        with pytest.raises(PRTError, match="compressed form: "):
            split(wrong)
