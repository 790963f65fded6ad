"""`BakeStore`: arrays and facts of a bake in a Zarr v3 group, chunked by block of points.

A chunk is written to a temporary file and then renamed, so a kill leaves whole chunks only; each
carries a checksum. Nothing is pickled, and nothing outside the folder is read or written.
"""

import json
import os
import shutil
import warnings
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from prt_core.errors import PRTError, expect, expect_one_of, expect_path


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
    from zarr.codecs import Crc32cCodec, ZstdCodec

FORMAT, VERSION = "prt bake", 2
# The fact that names the compressed form, and how its folders begin.
COMPRESSED = "compressed"
_CODECS = {"bytes", "zstd", "crc32c"}
_TYPES = {
    "bool", "int8", "uint8", "int16", "uint16", "int32", "int64", "float16", "float32", "float64",
}  # fmt: skip
_MOST_BYTES = 1 << 38


class BakeStore:
    """An open bake folder.

    Parameters
    ----------
    path : str or Path
        `NAME.prt`.
    mode : {"r", "a", "w"}
        Read what is there; go on with it or begin; begin anew.

    Raises
    ------
    PRTError
        The folder is no bake, of a newer version, or not one that this library wrote.
    """

    def __init__(self, path, mode="r"):
        self.path = expect_path("bake", path)
        expect_one_of("mode", mode, ("r", "a", "w"))
        if mode == "w":
            self._remove()
        there = self.path.exists() or self.path.is_symlink()
        if there:
            _check_folder(self.path)
        elif mode == "r":
            raise PRTError(f"{self.path}: there is no such bake")
        if not there:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            group = zarr.create_group(str(self.path), zarr_format=3)
            group.attrs.update({"format": FORMAT, "version": VERSION, "complete": False})
        self._group = zarr.open_group(str(self.path), mode="r" if mode == "r" else "r+")

    def _remove(self):
        if self.path.exists() or self.path.is_symlink():
            # Only a folder that is a bake may be removed; whole or not does not matter.
            _check_folder(self.path, whole=False)
            shutil.rmtree(self.path)

    @property
    def facts(self):
        """The group's attributes: settings, report, objects, versions."""
        return dict(self._group.attrs)

    def update(self, **facts):
        """Replace attributes, in one atomic write."""
        file = self.path / "zarr.json"
        meta = _json(file, self.path)
        meta["attributes"] = {**meta.get("attributes", {}), **facts}
        part = file.with_name("zarr.json.part")
        part.write_text(json.dumps(meta, default=_plain))
        part.replace(file)
        self._group = zarr.open_group(str(self.path), mode="r+")

    def __contains__(self, name):
        return name in self._group

    def write(self, name, array):
        """Write a whole array, replacing one of the same name."""
        array = np.ascontiguousarray(array)
        made = self.create(name, array.shape, array.dtype, None)
        if array.size:
            made[...] = array

    def create(self, name, shape, dtype, chunks, fill=0):
        """An array to be written block by block; opened as it is where it exists alike."""
        if name in self._group:
            existing = self._group[name]
            if existing.shape == tuple(shape) and existing.dtype == dtype:
                return existing
            del self._group[name]
        return self._group.create_array(
            name,
            shape=shape,
            dtype=dtype,
            chunks=chunks or tuple(max(1, n) for n in shape),
            fill_value=fill,
            compressors=[ZstdCodec(level=3), Crc32cCodec()],
        )

    def remove(self, name):
        """Remove an array, where it is there."""
        if name in self._group:
            del self._group[name]

    def remove_folder(self, name):
        """Remove a folder of arrays, whole or not."""
        shutil.rmtree(self.path / name)

    def has_chunk(self, name, *index):
        """Whether a chunk was written (chunks appear whole or not at all)."""
        return (self.path / name / "c" / "/".join(map(str, index))).is_file()

    def array(self, name):
        """The array itself, read where it is indexed."""
        try:
            return self._group[name]
        except KeyError:
            raise PRTError(f"{self.path}: '{name}' is missing; the bake is damaged") from None

    def read(self, name, shape=None, dtype=None):
        """A whole array into memory.

        Raises
        ------
        PRTError
            Missing, of another shape or type, or damaged (checksum, truncated).
        """
        array = self.array(name)
        fits = shape is None or (
            array.ndim == len(shape)
            and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))
        )
        expect(
            fits and (dtype is None or array.dtype == dtype),
            f"{self.path}: '{name}' is {array.shape} {array.dtype}, expected {shape} "
            f"{np.dtype(dtype) if dtype else ''}; the bake is damaged or not of this library",
        )
        try:
            return array[...]
        except Exception as error:
            raise PRTError(
                f"{self.path}: '{name}' cannot be read ({_short(error)}); the bake is damaged, "
                "bake again with --restart"
            ) from error

    def nbytes(self):
        """Bytes on disk."""
        return sum(
            (Path(folder) / name).stat().st_size
            for folder, _, names in os.walk(self.path)
            for name in names
        )


def _plain(value):
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value)} cannot be stored")


def _short(error):
    return (str(error).splitlines() or [type(error).__name__])[0][:120]


def _check_folder(path, whole=True):
    """Refuse what this library did not write, before any of it is decoded."""
    expect(not path.is_symlink(), f"{path}: is a symbolic link; give the folder itself")
    expect(path.is_dir(), f"{path}: is a file, expected a folder NAME.prt made by 'prt bake'")
    meta = _json(path / "zarr.json", path)
    facts = meta.get("attributes")
    expect(
        meta.get("zarr_format") == 3
        and meta.get("node_type") == "group"
        and isinstance(facts, dict)
        and facts.get("format") == FORMAT,
        f"{path}: is not a bake of this library; expected a folder made by 'prt bake'",
    )
    version = facts.get("version")
    expect(
        isinstance(version, int) and version <= VERSION,
        f"{path}: has store version {version}, this library reads {VERSION}; update it",
    )
    expect(
        version == VERSION or not whole,
        f"{path}: was baked by an older version of this library; bake again with --restart",
    )
    named = facts.get(COMPRESSED)
    kept = named.get("folder") if isinstance(named, dict) else None
    for folder, folders, names in os.walk(path):
        if Path(folder) == path:
            # What a kill left of a compressed form is nobody's: it is not read, only not a link.
            left = {f for f in folders if f.startswith(COMPRESSED) and f != kept}
        for name in folders + names:
            entry = Path(folder) / name
            expect(
                not entry.is_symlink(),
                f"{path}: holds a symbolic link ({name}); it was tampered with",
            )
        inside = Path(folder).relative_to(path).parts
        if whole and "zarr.json" in names and inside and inside[0] not in left:
            _check_array(_json(Path(folder) / "zarr.json", path), path, Path(folder).name)


def _check_array(meta, path, name):
    if meta.get("node_type") == "group":
        return
    codecs = [codec.get("name") if isinstance(codec, dict) else codec for codec in meta["codecs"]]
    shape = meta.get("shape", [])
    grid = meta.get("chunk_grid", {})
    key = meta.get("chunk_key_encoding", {})
    size = float(np.prod([float(n) for n in shape])) if shape else 1.0
    expect(
        meta.get("node_type") == "array"
        and set(codecs) <= _CODECS
        and meta.get("data_type") in _TYPES
        and not meta.get("storage_transformers")
        and grid.get("name") == "regular"
        and key.get("name") == "default"
        and 0 <= size * 8 < _MOST_BYTES,
        f"{path}: array '{name}' is described in a way this library never writes; "
        "it was damaged or tampered with",
    )


def _json(file, path):
    try:
        meta = json.loads(file.read_text())
        expect(isinstance(meta, dict), f"{path}: {file.name} is damaged")
        return meta
    except (OSError, UnicodeDecodeError, json.JSONDecodeError):
        raise PRTError(
            f"{path}: is not a bake of this library or is damaged ({file.name} cannot be read)"
        ) from None
