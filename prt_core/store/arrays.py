"""`BakeArray`: an array of a bake, read and written block by block; never believed unchecked."""

import math
from contextlib import contextmanager

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.store.attributes import digest
from prt_core.store.chunks import MEND, open_zarr


class BakeArray:
    """An array in a folder of its own.

    Parameters
    ----------
    files : Files
    name : str
    layout : Layout
    binding : str
        Of the bake (see `Chunks`).

    Attributes
    ----------
    shape : tuple of int
    dtype : numpy.dtype
    """

    def __init__(self, files, name, layout, binding):
        self.name, self.shape, self.dtype = name, layout.shape, np.dtype(layout.dtype)
        self._files, self._layout = files, layout
        self._array, self._chunks = open_zarr(files, name, layout, binding)

    def __len__(self):
        return self.shape[0]

    @property
    def chunks(self):
        """(n_axes,) tuple of int: the shape of a chunk."""
        return self._layout.chunks

    def __getitem__(self, selection):
        """A part of the array.

        Raises
        ------
        PRTError
            A chunk of it is missing or damaged.
        """
        with self._said():
            return self._array[selection]

    def __setitem__(self, selection, values):
        """Write whole chunks; what is in their place, damaged or not, is not read."""
        with self._said():
            self._array[selection] = values

    def holds(self, *selection):
        """Whether a part was written and is whole, as far as its digests tell.

        Parameters
        ----------
        *selection : int or slice
            Along the first axes.
        """
        try:
            for index in self._layout.touched(selection):
                self._chunks.load(_key(index))
        except PRTError:
            return False
        return True

    def expect_whole(self):
        """Raise `PRTError` unless the chunks that are there are all that belong there."""
        what, present = f"{self._files.root}: '{self.name}'", self._found()
        # Counted first: a forged shape may ask for more chunks than there is memory.
        n_missing = math.prod(self._layout.grid) - len(present)
        expect(n_missing <= 0, f"{what} lacks {n_missing:,} of its parts; {MEND}")
        outside = sorted(key for key in present if not self._is_inside(key))
        expect(not outside, f"{what} has a part ({''.join(outside[:1])}) outside its shape; {MEND}")

    def read(self):
        """The whole array into memory.

        Raises
        ------
        PRTError
            As by `expect_whole` and `[]`, before memory for it is taken.
        """
        self.expect_whole()
        return self[...]

    def digest(self):
        """Hexadecimal digest of the whole array: of its layout and the digests of its chunks."""
        self.expect_whole()
        keys = [_key(index) for index in self._layout.indices()]
        known = self._chunks.digests
        for key in keys:
            if key not in known:
                self._chunks.load(key)
        return digest(self.name.encode(), self._layout.text(), *(known[key] for key in keys))

    def cut(self):
        """Remove chunks that lie outside the shape, and what is in the way of those inside."""
        keys = [""]
        for depth in range(len(self.shape) + 1):
            last = depth == len(self.shape)
            for key in self._below(keys, folders=last):
                self._files.remove(self.name + key)
            keys = self._below(keys, folders=not last)
        for key in keys:
            if not self._is_inside(key[1:]):
                self._files.remove(self.name + key)

    def _is_inside(self, key):
        """Whether the array has a chunk of that key."""
        index = key.split("/")[1:]
        whole = all(part.isdecimal() and len(part) < 20 for part in index)
        index = tuple(map(int, index)) if whole else ()
        grid = self._layout.grid
        return (
            len(index) == len(grid)
            and all(i < n for i, n in zip(index, grid, strict=True))
            and key == _key(index)
        )

    def _found(self):
        """Keys of the chunks that are there."""
        keys = [""]
        for _ in range(len(self.shape) + 1):
            keys = self._below(keys)
        return {key[1:] for key in keys}

    def _below(self, keys, folders=None):
        """Keys of chunks, or of folders of them, in folders."""
        return [
            f"{key}/{name}"
            for key in keys
            for name in self._files.names(self.name + key, folders)
            if (name.isdigit() if key else name == "c")
        ]

    @contextmanager
    def _said(self):
        try:
            yield
        except PRTError:
            raise
        except Exception as error:
            reason = " ".join((str(error) or type(error).__name__).split())[:120]
            raise PRTError(
                f"{self._files.root}: '{self.name}' cannot be read ({reason}); {MEND}"
            ) from error


def _key(index):
    return "/".join(["c", *map(str, index)])
