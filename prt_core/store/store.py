"""`BakeStore`: attributes and arrays of a bake in a Zarr v3 group, which says when it is not whole.

    NAME.prt/zarr.json          the attributes, sealed (attributes.py)
             ARRAY/zarr.json    how it lies in chunks (layout.py)
             ARRAY/c/0/0 ...    the chunks, each with its digest (chunks.py)

Every file is written beside its place and renamed (files.py), or put whole into an object store
(object_files.py). A finished bake's attributes name
a digest of each of its arrays. Nothing is pickled; nothing outside the folder is read or written.
"""

import json

import numpy as np

from prt_core.errors import PRTError, expect, expect_one_of
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.array_parts import parts_of
from prt_core.runtime.renamed import renamed
from prt_core.store.arrays import BakeArray
from prt_core.store.attributes import (
    FILE,
    FORMAT,
    VERSION,
    damage_as_error,
    digest,
    read_attributes,
    write_attributes,
)
from prt_core.store.chunks import MEND
from prt_core.store.layout import MOST_TEXT, Layout
from prt_core.store.object_files import files_at
from prt_core.store.places import expect_only_arrays, finish_swap

# The attributes that name the compressed form and that of gloss, and how their folders begin.
COMPRESSED, GLOSS_FORM = "compressed", "glossform"
_MODES = ("r", "r+", "a")


class BakeStore:
    """An open bake folder.

    Parameters
    ----------
    path : str, Path or Address
        `NAME.prt`, or s3://BUCKET/NAME.prt (see `Address`).
    mode : {"r", "r+", "a"}
        Read what is there; write to it as well; the same, and begin where there is nothing yet.
        The folder is made when the first attribute or array is written.

    Attributes
    ----------
    files : Files or ObjectFiles
        Of the folder.

    Raises
    ------
    PRTError
        The folder is no bake, of another version, damaged, or not one that this library wrote.
    """

    def __init__(self, path, mode="r"):
        expect_one_of("mode", mode, _MODES)
        self.path = expect_store_path("bake", path)
        self.files = files_at(self.path)
        finish_swap(self.path)
        exists = self.files.exists()
        expect(exists or mode == "a", f"{path}: there is no such bake")
        self._made, self._used = exists, set()
        self._attributes = read_attributes(self.files) if exists else None
        if self._attributes is None:
            expect(
                mode == "a",
                f"{path}: holds no bake, or one that was stopped in its first moments; 'prt bake' "
                "begins it",
            )
            if exists:
                # Arrays without attributes do no harm: each chunk says itself what it belongs to.
                expect_only_arrays(self.path)
            self._attributes = {"format": FORMAT, "version": VERSION, "complete": False}
        if exists:
            if mode != "r":
                self.files.sweep()
            self.files.check()

    @property
    def attributes(self):
        """The group's attributes: settings, report, objects, versions."""
        return dict(self._attributes)

    facts = renamed("facts", "attributes")

    def update(self, without=(), **attributes):
        """Replace attributes, in one atomic write that is on the disk when this returns.

        Where they are what is there, nothing is written. Those named in `without` are taken away.

        Raises
        ------
        PRTError
            Another program replaced them meanwhile, or removed the folder.
        """
        if not self._made:
            self.files.make()
            self._made = True
        now = read_attributes(self.files)
        expect(
            (now or {}).get("seal") == self._attributes.get("seal"),
            f"{self.path}: another program changed or removed this bake meanwhile; nothing more "
            "is written, run the same command again",
        )
        kept = {key: value for key, value in self._attributes.items() if key not in without}
        self._attributes = write_attributes(self.files, {**kept, **attributes}, now)

    @property
    def is_complete(self):
        """Whether the bake says that it is finished."""
        return self._attributes.get("complete") is True

    def __contains__(self, name):
        return FILE in self.files.names(name)

    def names(self):
        """Names of the arrays of the bake; those of its compressed form are not among them."""
        return [name for name in self.files.names() if name.isidentifier() and name in self]

    def write(self, name, array):
        """Write a whole array, replacing one of the same name; returns the `BakeArray`."""
        array = np.asarray(array)
        array_store = self.create(name, array.shape, array.dtype)
        if array.size:
            array_store[...] = array
        return array_store

    def keep(self, name, array):
        """`write(name, array)`, but where that is there already, whole and the same."""
        array = np.asarray(array)
        try:
            stored = self.read(name, array.shape, array.dtype)
        except PRTError:
            stored = None
        # Bit by bit, so that NaN is itself.
        if stored is None or any(
            one.tobytes() != two.tobytes()
            for one, two in zip(parts_of(stored), parts_of(array), strict=True)
        ):
            self.write(name, array)

    def create(self, name, shape, dtype, chunks=None):
        """An array to be written block by block.

        What is there of it stays, as far as it is of the same type and chunks: each chunk has a
        digest that says so (see `BakeArray.holds`). Chunks outside of the shape are removed.

        Parameters
        ----------
        name : str
        shape : tuple of int
        dtype : dtype
        chunks : tuple of int, optional
            See `Layout.of`.

        Returns
        -------
        BakeArray
        """
        if not self._made:
            self.update()
        layout = Layout.of(shape, dtype, chunks)
        text = layout.text()
        try:
            same = self.files.read(f"{name}/{FILE}", MOST_TEXT) == text
        except PRTError:
            same = False
        if not same:
            self.files.write(f"{name}/{FILE}", text)
        self._used.add(name)
        created = BakeArray(self.files, name, layout, self._binding)
        created.cut()
        return created

    def remove(self, name):
        """Remove an array, or a folder of arrays, of this `name`, where it is there."""
        self.files.remove(name)
        self._used.discard(name)

    def array(self, name):
        """The array of this `name` itself, read where it is indexed.

        Raises
        ------
        PRTError
            It is missing, or described as this library never does.
        """
        text = self.files.read(f"{name}/{FILE}", MOST_TEXT)
        expect(text is not None, f"{self.path}: '{name}' is missing; {MEND}")
        layout = Layout.read(text, f"{self.path}: array '{name}'")
        self._used.add(name)
        return BakeArray(self.files, name, layout, self._binding)

    def read(self, name, shape=None, dtype=None):
        """A whole array into memory.

        Parameters
        ----------
        name : str
        shape : tuple of int or None, optional
            None: any length.
        dtype : str, optional

        Raises
        ------
        PRTError
            Missing, of another shape or type, damaged, or not what the bake was finished with.
        """
        array = self.array(name)
        self.expect_shape(array, shape, dtype)
        values = array.read()
        self.expect_sealed(array)
        return values

    def expect_shape(self, array, shape=None, dtype=None):
        """Raise `PRTError` unless an array is of a `shape` (None: any length) and a `dtype`."""
        fits = shape is None or (
            len(array.shape) == len(shape)
            and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))
        )
        expect(
            fits and (dtype is None or array.dtype == dtype),
            f"{self.path}: '{array.name}' is {array.shape} {array.dtype}, expected {shape} "
            f"{np.dtype(dtype) if dtype else ''}; {MEND}",
        )

    def expect_sealed(self, array):
        """Raise `PRTError` unless an array is the one that the bake was finished with."""
        if not self.is_complete:
            return
        with damage_as_error(self.path, "its list of arrays"):
            folder, _, name = array.name.rpartition("/")
            slot = folder.rstrip("0123456789")
            noted = (self._attributes[slot] if folder else self._attributes)["arrays"]
            expect(
                name in noted and array.digest() == noted[name],
                f"{self.path}: '{array.name}' is not what the bake was finished with; {MEND}",
            )

    def take_all(self):
        """Count all arrays that are there as this object's, for `seal`."""
        self._used.update(self.names())

    def seal(self, without=(), dropped=(), **attributes):
        """Finish the bake: note a digest of each array, and attributes, once all is on the disk.

        Attributes named in `without` are taken away, then the arrays `dropped`. Arrays are those
        that were written or read by this object; others are nobody's.
        """
        self._used.difference_update(dropped)
        self.files.sync()
        arrays = {name: self.array(name).digest() for name in sorted(self._used)}
        self.update(without, arrays=arrays, complete=True, **attributes)
        for name in dropped:
            self.remove(name)

    def is_sound(self):
        """Whether all arrays are what the bake was finished with."""
        try:
            with damage_as_error(self.path):
                for name in self._attributes["arrays"]:
                    self.expect_sealed(self.array(name))
        except PRTError:
            return False
        return True

    def nbytes(self):
        """Bytes on disk."""
        return self.files.nbytes()

    @property
    def _binding(self):
        """What chunks belong to: scene, settings, where its details lie, what they came from."""
        bound = [self._attributes.get(name) for name in ("identity", "details")]
        taken = self._attributes.get("taken_from")
        bound += [taken] if taken else []
        return digest(json.dumps(bound, sort_keys=True).encode())
