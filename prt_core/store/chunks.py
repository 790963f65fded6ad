"""The chunks of an array as files, each with a digest of its own that binds it to its place.

A chunk file is a zstd frame and, after it, a skippable frame (RFC 8878) with a digest of what is in
the first, of the array's name and type, of the chunk's index and of the bake. Other readers of zarr
pass over it; here a chunk that was damaged, cut short, or belongs elsewhere is never decoded.
"""

import asyncio
import hashlib
import struct
import warnings
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np

from prt_core.errors import PRTError, expect


@contextmanager
def _as_zarr_wants_it():
    """Blender 4.2 and 4.3 bring numpy 1.24; all that zarr 3.0 misses there is one name.

    And newer numcodecs warn of the crc32c that zarr 3.0 asks for, which is not the user's affair.
    """
    missing = not hasattr(np, "dtypes")
    if missing:
        np.dtypes = SimpleNamespace(ObjectDType=lambda: np.dtype(object))
    try:
        # Kept rather than filtered: numcodecs puts its own filter before any other.
        with warnings.catch_warnings(record=True):
            yield
    finally:
        if missing:
            del np.dtypes


with _as_zarr_wants_it():
    import zarr
    from zarr.abc.store import Store
    from zarr.storage import StorePath

# What to do about a damaged array: a bake that goes on casts again what is not whole.
MEND = "the bake is damaged, bake again to have that part made again"
_DIGEST = 16
_TAIL = struct.Struct(f"<II{_DIGEST}s")
_SKIPPABLE, _FRAME = 0x184D2A5D, 0xFD2FB528
# zstd takes a little more for what it cannot compress.
_MOST_OVERHEAD = 1 << 12


def open_zarr(files, name, layout, binding):
    """A `zarr.Array` that reads and writes checked chunks, and the `Chunks` behind it.

    zarr is told how the array lies by us and reads no file but chunks, so that nothing a file
    says reaches it unchecked.
    """
    chunks = Chunks(files, name, layout, binding)
    inner = zarr.AsyncArray(
        # An array of zeros is written as well: a chunk that is not there was never written.
        layout.described(), StorePath(chunks), {"write_empty_chunks": True}
    )  # fmt: skip
    return zarr.Array(inner), chunks


class Chunks(Store):
    """zarr's way to the chunks of one array.

    Parameters
    ----------
    files : Files
        Or anything else with its `read` and `write`.
    name : str
        Of the array.
    layout : Layout
    binding : str
        Of the bake: chunks of another one are refused.

    Attributes
    ----------
    digests : dict of str -> bytes
        Of the chunks that were read or written, by their key.
    """

    supports_writes = supports_deletes = supports_listing = True
    supports_partial_writes = False

    def __init__(self, files, name, layout, binding):
        super().__init__(read_only=False)
        self._is_open = True
        self._files, self._name, self._layout = files, name, layout
        self._binding = f"{binding} {name} {layout.dtype} {layout.chunks} "
        self.digests = {}

    def __eq__(self, other):
        return self is other

    def load(self, key):
        """The zstd frame of a chunk.

        Raises
        ------
        PRTError
            The chunk is missing, damaged, or not this one.
        """
        what = f"{self._files.root}: '{self._name}'"
        size = self._layout.chunk_bytes
        data = self._files.read(f"{self._name}/{key}", size + size // 128 + _MOST_OVERHEAD)
        expect(data is not None, f"{what} lacks a part ({key}); {MEND}")
        frame, digest = data[: -_TAIL.size], self._digest(key, data[: -_TAIL.size])
        expect(
            data[-_TAIL.size :] == _TAIL.pack(_SKIPPABLE, _DIGEST, digest),
            f"{what} cannot be read: a part of it ({key}) is not what was written there; {MEND}",
        )
        expect(
            _decoded_size(frame) == size,
            f"{what} cannot be read: a part of it ({key}) has another size than described; {MEND}",
        )
        self.digests[key] = digest
        return frame

    def keep(self, key, frame):
        """Write the zstd frame of a chunk."""
        digest = self._digest(key, frame)
        tail = _TAIL.pack(_SKIPPABLE, _DIGEST, digest)
        self._files.write(f"{self._name}/{key}", frame + tail)
        self.digests[key] = digest

    def _digest(self, key, frame):
        state = hashlib.blake2b((self._binding + key).encode(), digest_size=_DIGEST)
        state.update(frame)
        return state.digest()

    # What zarr calls; the rest it asks a store to have.

    async def get(self, key, prototype, byte_range=None):
        return prototype.buffer.from_bytes(await asyncio.to_thread(self.load, key))

    async def set(self, key, value, byte_range=None):
        await asyncio.to_thread(self.keep, key, value.to_bytes())

    async def exists(self, key):
        name, most = f"{self._name}/{key}", self._layout.chunk_bytes + _MOST_OVERHEAD
        return await asyncio.to_thread(self._files.read, name, most) is not None

    async def delete(self, key):
        await asyncio.to_thread(self._files.remove, f"{self._name}/{key}")

    # Zarr's stores have these two; no chunk of ours is read or written in parts.
    async def get_partial_values(self, *_):
        raise PRTError(f"{self._name}: expected to be read by whole chunks, not in parts")

    async def set_partial_values(self, *_):
        """Refused, as zarr's own."""
        raise PRTError(f"{self._name}: expected to be written by whole chunks, not in parts")

    async def list(self):
        return
        yield

    def list_prefix(self, prefix):
        return self.list()

    def list_dir(self, prefix):
        return self.list()


def _decoded_size(frame):
    """The size that a zstd frame says it decodes to (RFC 8878, 3.1.1.1), None where it does not."""
    if len(frame) < 6 or int.from_bytes(frame[:4], "little") != _FRAME:
        return None
    head = frame[4]
    single = head >> 5 & 1
    width = (1 if single else 0, 2, 4, 8)[head >> 6]
    start = 5 + (not single) + (0, 1, 2, 4)[head & 3]
    field = frame[start : start + width]
    if not width or len(field) < width:
        return None
    return int.from_bytes(field, "little") + (256 if width == 2 else 0)
