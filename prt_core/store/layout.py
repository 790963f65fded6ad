"""How an array lies in chunks: shape, type, chunk shape, and the one way to say so in zarr's words.

What is read must be, word by word, what would be written for the same shape and type. So there is
nothing in it that could ask for another codec, another grid or more memory.
"""

import itertools
import json
import math
from dataclasses import dataclass

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.store.attributes import parse

# Bytes of a decoded chunk, at most: what a reader must be ready to allocate for it.
MOST_CHUNK = 16 << 20
# Bytes of an array's description, at most.
MOST_TEXT = 1 << 14
TYPES = (
    "bool", "int8", "uint8", "int16", "uint16", "int32", "int64", "float16", "float32", "float64",
)  # fmt: skip
ZSTD_LEVEL = 3
_MOST_AXES = 6
_MOST_BYTES = 1 << 40


@dataclass(frozen=True)
class Layout:
    """Shape, type and chunks of an array.

    Parameters
    ----------
    shape : tuple of int
    dtype : str
        One of `TYPES`.
    chunks : tuple of int
        Shape of a chunk; those at the end reach over the array.
    """

    shape: tuple
    dtype: str
    chunks: tuple

    @classmethod
    def of(cls, shape, dtype, chunks=None):
        """A layout whose chunks are small enough to be read.

        Parameters
        ----------
        shape : tuple of int
        dtype : dtype
        chunks : tuple of int, optional
            Cut along its first axis, into even parts, where it is too large. Default: as many
            rows as fit.
        """
        shape = tuple(int(n) for n in shape)
        name = np.dtype(dtype).name
        expect(
            name in TYPES and shape,
            f"store: cannot keep an array of {name} and shape {shape}, expected an axis or more of "
            f"{', '.join(TYPES)}",
        )
        size = np.dtype(dtype).itemsize
        if chunks is None:
            chunks = [max(1, n) for n in shape]
            for axis in range(len(shape)):
                row = size * math.prod(chunks[axis + 1 :])
                chunks[axis] = max(1, min(chunks[axis], MOST_CHUNK // row))
                if row <= MOST_CHUNK:
                    break
        else:
            row = size * math.prod(chunks[1:])
            fits = [n for n in range(1, chunks[0] + 1) if chunks[0] % n == 0]
            rows = max((n for n in fits if n * row <= MOST_CHUNK), default=1)
            chunks = [min(n, max(1, m)) for n, m in zip((rows, *chunks[1:]), shape, strict=True)]
        return cls(shape, name, tuple(int(n) for n in chunks))

    @classmethod
    def read(cls, text, what):
        """The layout that `text` describes; `what` names it in errors."""
        meta = parse(text, f"{what} (its description")
        try:
            shape = tuple(meta["shape"])
            chunks = tuple(meta["chunk_grid"]["configuration"]["chunk_shape"])
            whole = all(type(n) is int for n in shape + chunks)
            layout = cls(shape, meta["data_type"], chunks)
            good = whole and layout._is_small() and meta == layout.described()
        except (LookupError, TypeError, ValueError):
            good = False
        if not good:
            raise PRTError(
                f"{what} is described in a way this library never writes; it was damaged or "
                "tampered with"
            )
        return layout

    def described(self):
        """A dict in zarr's words (Zarr storage specification, version 3)."""
        kind = np.dtype(self.dtype).kind
        return {
            "zarr_format": 3,
            "node_type": "array",
            "shape": list(self.shape),
            "data_type": self.dtype,
            "chunk_grid": {
                "name": "regular",
                "configuration": {"chunk_shape": list(self.chunks)},
            },
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "fill_value": {"b": False, "f": 0.0}.get(kind, 0),
            "codecs": [
                {"name": "bytes", "configuration": {"endian": "little"}},
                {"name": "zstd", "configuration": {"level": ZSTD_LEVEL, "checksum": False}},
            ],
            "attributes": {},
        }

    def text(self):
        """`described` as JSON, in bytes."""
        return json.dumps(self.described()).encode()

    @property
    def chunk_bytes(self):
        """Bytes of a decoded chunk."""
        return math.prod(self.chunks) * np.dtype(self.dtype).itemsize

    @property
    def grid(self):
        """Number of chunks along each axis."""
        return tuple(-(-n // m) for n, m in zip(self.shape, self.chunks, strict=True))

    def indices(self):
        """Indices of all chunks, in order."""
        return itertools.product(*map(range, self.grid))

    def touched(self, selection):
        """Indices of the chunks that a selection (whole numbers, slices with both ends) reaches."""
        ranges = []
        for axis, (length, size) in enumerate(zip(self.shape, self.chunks, strict=True)):
            part = selection[axis] if axis < len(selection) else slice(0, length)
            part = part if isinstance(part, slice) else slice(part, part + 1)
            ranges.append(range(part.start // size, -(-min(part.stop, length) // size)))
        return itertools.product(*ranges)

    def _is_small(self):
        return (
            1 <= len(self.shape) == len(self.chunks) <= _MOST_AXES
            and self.dtype in TYPES
            and min(self.shape) >= 0
            and min(self.chunks) >= 1
            and self.chunk_bytes <= MOST_CHUNK
            and math.prod(self.shape) * np.dtype(self.dtype).itemsize < _MOST_BYTES
            and all(n <= max(1, m) for n, m in zip(self.chunks, self.shape, strict=True))
        )
