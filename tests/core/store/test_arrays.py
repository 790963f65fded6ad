"""Arrays in chunks: where they lie, and that no chunk is believed elsewhere or otherwise."""

import os
import shutil
import struct

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.store import BakeStore
from prt_core.store.chunks import Chunks
from prt_core.store.layout import MOST_CHUNK, TYPES, Layout

IDENTITY = {"scene": "a", "seed": 3}


@pytest.fixture
def store(tmp_path):
    built = BakeStore(tmp_path / "a.prt", "a")
    built.update(identity=IDENTITY)
    return built


def filled(store, name="some", dtype="int32", shape=(11, 7), chunks=(3, 7)):
    built = store.create(name, shape, dtype, chunks)
    built[...] = np.arange(np.prod(shape)).reshape(shape) % 100
    return built


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("shape", [(5,), (0, 3), (2, 3, 5), (7, 11), (1, 1, 1, 1)])
def test_every_type_and_shape_is_read_bit_by_bit(store, dtype, shape):
    values = (np.random.default_rng(2).random(shape) * 3).astype(dtype)
    store.write("some", values)
    result = store.read("some", shape, dtype)
    assert result.dtype == values.dtype
    np.testing.assert_array_equal(result, values)


@pytest.mark.parametrize("value", [0, 255])
def test_chunks_of_one_value_are_written_as_well(store, value):
    built = store.create("some", (7, 3), "uint8", (2, 3))
    built[...] = np.full((7, 3), value, np.uint8)
    assert sorted(os.listdir(store.path / "some" / "c")) == ["0", "1", "2", "3"]


@pytest.mark.parametrize(
    "shape, dtype, chunks, wanted",
    [
        ((10**7, 3), "float32", None, (MOST_CHUNK // 12, 3)),
        ((3, 10**7), "float32", None, (1, MOST_CHUNK // 4)),
        ((0, 3), "int8", None, (1, 3)),
        ((5000, 98304), "uint8", (2048, 98304), (128, 98304)),
        ((5, 98304), "uint8", (2048, 98304), (5, 98304)),
        ((100, 64), "int32", (2048, 32), (100, 32)),
    ],
)
def test_chunks_are_never_larger_than_a_reader_takes(shape, dtype, chunks, wanted):
    layout = Layout.of(shape, dtype, chunks)
    assert layout.chunks == wanted and layout.chunk_bytes <= MOST_CHUNK
    assert Layout.read(layout.text(), "x") == layout


def test_what_was_written_is_held_and_nothing_else(store):
    built = store.create("some", (11, 14), "int32", (3, 7))
    built[3:6, :7] = 5
    assert built.holds(slice(3, 6), slice(0, 7))
    assert not built.holds(slice(3, 6)) and not built.holds(slice(3, 6), slice(7, 14))
    assert not built.holds(slice(0, 6), slice(0, 7)) and not built.holds(0, 0)
    built[9:11] = 6
    assert built.holds(slice(9, 11)) and built.holds(10, 13)
    with pytest.raises(PRTError, match="'some' lacks 5 of its parts"):
        built.read()
    with pytest.raises(PRTError, match="'some' lacks a part \\(c/0/"):
        built[0:3]


def test_blocks_that_are_cut_into_chunks_are_held_whole_or_not(store, monkeypatch):
    monkeypatch.setattr("prt_core.store.layout.MOST_CHUNK", 64)
    built = store.create("some", (16, 16), "uint8", (8, 16))
    built[8:16] = 3
    assert built.holds(slice(8, 16)) and not built.holds(slice(0, 8))
    (store.path / "some" / "c" / "3" / "0").unlink()
    assert not built.holds(slice(8, 16))


def test_a_smaller_shape_keeps_its_chunks_and_drops_the_others(store):
    filled(store, shape=(11, 14))
    digest = store.array("some").digest()
    smaller = store.create("some", (11, 7), "int32", (3, 7))
    np.testing.assert_array_equal(smaller.read()[:, 3], np.arange(3, 154, 14) % 100)
    assert smaller.digest() != digest and not (store.path / "some/c/0/1").exists()


def test_an_array_of_another_shape_has_another_digest(store):
    """Also where it lies in the same chunks."""
    filled(store)
    digest = store.array("some").digest()
    assert store.create("some", (10, 7), "int32", (3, 7)).digest() != digest
    assert store.create("some", (11, 7), "int32", (3, 7)).digest() == digest


def chunk(store, index, name="some"):
    return store.path / name / "c" / str(index) / "0"


def _flip(store):
    file = chunk(store, 1)
    data = bytearray(file.read_bytes())
    data[-1] ^= 1
    file.write_bytes(bytes(data))


def _other_array(store):
    filled(store, "other")
    shutil.copyfile(chunk(store, 1, "other"), chunk(store, 1))


def _other_bake(store):
    other = BakeStore(store.path.with_name("b.prt"), "a")
    other.update(identity={**IDENTITY, "seed": 5})
    filled(other)
    shutil.copyfile(chunk(other, 1), chunk(store, 1))


@pytest.mark.parametrize(
    "damage",
    [
        _flip,
        _other_array,
        _other_bake,
        lambda store: shutil.copyfile(chunk(store, 0), chunk(store, 1)),
        lambda store: chunk(store, 1).write_bytes(b""),
        lambda store: chunk(store, 1).write_bytes(chunk(store, 1).read_bytes()[:-1]),
        lambda store: chunk(store, 1).write_bytes(chunk(store, 1).read_bytes() + b"x"),
        lambda store: chunk(store, 1).write_bytes(bytes(10**6)),
        lambda store: chunk(store, 1).unlink(),
    ],
)
def test_a_chunk_that_is_not_what_was_written_there_is_not_held(store, damage):
    built = filled(store)
    assert built.holds(slice(0, 11))
    damage(store)
    built = store.create("some", (11, 7), "int32", (3, 7))
    assert built.holds(slice(0, 3)) and not built.holds(slice(3, 6))
    with pytest.raises(PRTError, match="'some' (cannot be read|lacks)|has 1,000,000 bytes"):
        built.read()
    with pytest.raises(PRTError):
        built[3:6]
    built[3:6] = np.arange(21, 42).reshape(3, 7)
    np.testing.assert_array_equal(built.read().ravel(), np.arange(77))


def forged(store, data):
    """A chunk with any frame in it, and the digest that belongs to that."""
    built = filled(store)
    Chunks(store.files, "some", built._layout, store._binding).keep("c/1/0", data)
    return store.array("some")


def frame(size):
    """A frame that says it decodes to `size` bytes, and holds none."""
    return struct.pack("<IBBQ", 0xFD2FB528, 0xC0, 0x70, size) + b"\1\0\0"


@pytest.mark.parametrize("size", [5 << 30, 85, 83, 0, (1 << 64) - 1])
def test_a_chunk_that_would_decode_to_another_size_is_not_decoded(store, size):
    with pytest.raises(PRTError, match="has another size than described"):
        forged(store, frame(size))[3:6]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"x" * 20,
        struct.pack("<I", 0xFD2FB528),
        # No size is given: the decoder would have to find out.
        struct.pack("<IBB", 0xFD2FB528, 0x00, 0x70) + b"\1\0\0",
        struct.pack("<IB", 0xFD2FB528, 0xE3),
    ],
)
def test_a_chunk_without_a_size_is_not_decoded(store, data):
    with pytest.raises(PRTError, match="has another size than described"):
        forged(store, data)[3:6]


def test_a_chunk_that_lies_about_its_size_is_one_line(store):
    built = forged(store, frame(84))
    with pytest.raises(PRTError, match="'some' cannot be read") as caught:
        built[3:6]
    assert "\n" not in str(caught.value)


def test_a_forged_shape_takes_no_memory(store):
    filled(store)
    text = Layout((1 << 36, 7), "int8", (1, 7)).text()
    store.files.write("some/zarr.json", text)
    array = store.array("some")
    for call in (array.read, array.digest, array.expect_whole):
        with pytest.raises(PRTError, match="lacks 68,719,476,732 of its parts"):
            call()


def test_types_that_are_not_kept_are_said(store):
    for values in (np.array(["a"]), np.array([1j]), np.array([None]), np.array(5)):
        with pytest.raises(PRTError, match="cannot keep an array of"):
            store.write("some", values)
