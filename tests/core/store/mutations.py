"""Ways to damage a bake: a mutation takes a random generator, a bake and the files outside.

It changes the bake in place, may plant what leads to the files outside, and raises `Nothing` where
it finds nothing to work on.
"""

import json
import os
import shutil
import socket
import struct
from pathlib import Path

import numpy as np

from prt_core.errors import PRTError
from prt_core.store import BakeStore
from prt_core.store.attributes import write_attributes

# What a mutation works on.


def files(path):
    return sorted(p for p in path.rglob("*") if p.is_file() and not p.is_symlink())


def chunks(path):
    return [p for p in files(path) if p.name.isdigit()]


def texts(path):
    return [p for p in files(path) if p.name == "zarr.json" and p.parent != path]


def arrays(path):
    return [p.parent for p in texts(path)]


class Nothing(Exception):
    """A mutation finds nothing that it could work on."""


def pick(rng, items):
    if not len(items):
        raise Nothing
    return items[int(rng.integers(len(items)))]


def two_of(rng, items):
    first = pick(rng, items)
    return first, pick(rng, [item for item in items if item != first])


def some_file(rng, path):
    """Attributes, a description or a chunk: each third of the time, for chunks are many."""
    groups = [path / "zarr.json"], texts(path), chunks(path)
    return pick(rng, pick(rng, [subset for subset in groups if subset and subset[0].exists()]))


# Bytes of files.


def flip(rng, path, canary):
    file = some_file(rng, path)
    data = bytearray(file.read_bytes())
    for place in rng.integers(len(data), size=int(rng.integers(1, 4))):
        data[place] ^= 1 << int(rng.integers(8))
    file.write_bytes(bytes(data))


def truncate(rng, path, canary):
    file = some_file(rng, path)
    os.truncate(file, int(rng.integers(file.stat().st_size)))


def extend(rng, path, canary):
    file = some_file(rng, path)
    file.write_bytes(file.read_bytes() + rng.bytes(int(rng.integers(1, 99))))


def overwrite(rng, path, canary):
    file = some_file(rng, path)
    file.write_bytes(rng.bytes(file.stat().st_size))


def delete(rng, path, canary):
    some_file(rng, path).unlink()


def delete_folder(rng, path, canary):
    shutil.rmtree(pick(rng, arrays(path)))


# Files that take each other's place.


def swap_files(rng, path, canary):
    _swap(*two_of(rng, chunks(path)))


def swap_chunks(rng, path, canary):
    """Of one array."""
    many = [a for a in arrays(path) if len(chunks(a)) > 1]
    _swap(*two_of(rng, chunks(pick(rng, many))))


def copy_chunk(rng, path, canary):
    shutil.copyfile(*two_of(rng, chunks(path)))


def swap_arrays(rng, path, canary):
    _swap(*two_of(rng, arrays(path)))


def swap_alike(rng, path, canary):
    """Two arrays of one shape and type, which are believed the easiest."""
    alike = {}
    for text in texts(path):
        alike.setdefault(text.read_bytes(), []).append(text.parent)
    one, two = two_of(rng, pick(rng, [subset for subset in alike.values() if len(subset) > 1]))
    if rng.random() < 0.5:
        _swap(one, two)
    else:
        shutil.rmtree(two)
        shutil.copytree(one, two)


def rename(rng, path, canary):
    file = pick(rng, [*files(path), *arrays(path)])
    name = pick(rng, ["0", "1", "99", "x", "zarr.json", "c", "visibility", "world9", "compressed1"])
    target = file.with_name(name)
    if not target.exists():
        os.rename(file, target)


def add_chunk(rng, path, canary):
    file = pick(rng, chunks(path))
    shutil.copyfile(file, file.with_name(str(int(rng.integers(100)))))


def add_file(rng, path, canary):
    names = ["notes.txt", ".DS_Store", "Thumbs.db", "0.part", "zarr.json.bak", "c", "visibility2"]
    folder = pick(rng, [path, *arrays(path)])
    file = folder / pick(rng, names)
    if not file.exists():
        file.write_bytes(rng.bytes(50))


def add_part(rng, path, canary):
    """What a kill leaves, of this version and others."""
    file = pick(rng, files(path))
    token = rng.bytes(16).hex()
    name = pick(rng, [f".{token[:16]}.part", f".{token}.partial", ".part"])
    file.with_name(file.name + name).write_bytes(file.read_bytes()[: int(rng.integers(9))])


def _swap(one, two):
    between = Path(one).with_name("swapping")
    os.rename(one, between)
    os.rename(two, one)
    os.rename(between, two)


# JSON.

_VALUES = [
    None, True, False, 0, 1, -1, 2, 3.5, 1e308, -1e308, 2**31, 2**62, 2**63, 10**30, "", "x",
    "../x", "\n", "\ud800", "7", [], {}, [[]], [1, 2, 3], {"a": 1}, float("nan"), float("inf"),
]  # fmt: skip


def _places(value, place=()):
    yield place
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield from _places(value[key], (*place, key))


def _edit(rng, meta, value_of=lambda rng: pick(rng, _VALUES)):
    places = [p for p in _places(meta) if p]
    # Places near the root as often as those of the many numbers below.
    depth = int(rng.integers(1, 1 + max(map(len, places))))
    *way, last = pick(rng, [p for p in places if len(p) == depth])
    inside = meta
    for key in way:
        inside = inside[key]
    if isinstance(inside, dict) and rng.random() < 0.25:
        del inside[last]
    elif isinstance(inside[last], int | float) and rng.random() < 0.4:
        inside[last] = inside[last] * 2 + 1
    else:
        inside[last] = value_of(rng)


def edit_facts(rng, path, canary):
    meta = json.loads((path / "zarr.json").read_text())
    _edit(rng, meta)
    (path / "zarr.json").write_text(json.dumps(meta))


def edit_description(rng, path, canary):
    file = pick(rng, texts(path))
    meta = json.loads(file.read_text())
    _edit(rng, meta)
    file.write_text(json.dumps(meta))


def edit_shape(rng, path, canary):
    file = pick(rng, texts(path))
    meta = json.loads(file.read_text())
    grid = meta["chunk_grid"]["configuration"]
    sizes = [0, 1, 2, 5, 2**20, 2**31, 2**40, 2**62]
    what = pick(rng, ["shape", "chunks", "both", "type", "codecs", "fill"])
    if what in ("shape", "both"):
        meta["shape"][int(rng.integers(len(meta["shape"])))] = pick(rng, sizes)
    if what in ("chunks", "both"):
        grid["chunk_shape"][int(rng.integers(len(meta["shape"])))] = pick(rng, sizes)
    if what == "type":
        meta["data_type"] = pick(rng, ["float64", "uint8", "object", "r64", "complex128", "string"])
    if what == "codecs":
        codec = pick(rng, ["gzip", "blosc", "sharding_indexed", "vlen-utf8", "numcodecs.pickle"])
        meta["codecs"].insert(int(rng.integers(3)), {"name": codec, "configuration": {}})
    if what == "fill":
        meta["fill_value"] = pick(rng, [1, -1, "NaN", "0x7fc00000", None, [0]])
    file.write_text(json.dumps(meta))


def malformed(rng, path, canary):
    file = pick(rng, [path / "zarr.json", pick(rng, texts(path))])
    text = file.read_text()
    deep = 10 ** int(rng.integers(2, 6))
    file.write_text(
        pick(rng, [
            "", "{", "[]", "null", "7", '"x"', text[:-1], text + "}", text.replace(":", "=", 1),
            "[" * deep, '{"a":' * deep, '{"attributes": ' + "[" * deep + "]" * deep + "}",
            text.replace("{", '{"zarr_format": 3, ', 1), text.replace("3", "9" * 5000, 1),
            text.replace(": 0", ": NaN", 1), text.replace(": ", ": 1e999, \"b\": ", 1),
            "\ufeff" + text, "\0" * 100, text.replace('"', "'"),
        ])
    )  # fmt: skip


def huge_text(rng, path, canary):
    file = pick(rng, [path / "zarr.json", pick(rng, texts(path))])
    size = pick(rng, [1 << 20, 15 << 20, 40 << 20])
    unit = pick(rng, ["[],", "{},", '"",', "0,"])
    file.write_text('{"attributes": [' + unit * (size // len(unit)) + "0]}")


def consolidated(rng, path, canary):
    """What zarr would believe instead of the descriptions of the arrays."""
    meta = json.loads((path / "zarr.json").read_text())
    parts = {t.parent.name: json.loads(t.read_text()) for t in texts(path)}
    pick(rng, list(parts.values()))["fill_value"] = 1
    meta["consolidated_metadata"] = {"kind": "inline", "must_understand": False, "metadata": parts}
    (path / "zarr.json").write_text(json.dumps(meta))


# What was planted.


def plant(rng, path, canary):
    """In place of a file or folder."""
    target = pick(rng, [*files(path), *arrays(path), path / "zarr.json"])
    shutil.rmtree(target) if target.is_dir() else target.unlink()
    _plant(rng, target, canary)


def plant_beside(rng, path, canary):
    """Under a new name: one of ours, of a part file, or any."""
    folder = pick(rng, [path, *arrays(path)])
    token = rng.bytes(16).hex()
    names = [f"zarr.json.{token[:16]}.part", "zarr.json.part", f"zarr.{token}.partial", "x", "c99",
             "99", "compressed9", "world9"]  # fmt: skip
    target = folder / pick(rng, names)
    if not target.exists():
        _plant(rng, target, canary)


def _plant(rng, target, canary):
    outside = pick(rng, [canary / "file", canary / "folder", canary / "bake.prt" / "zarr.json"])
    kind = pick(rng, ["symlink", "loop", "dangling", "hard link", "pipe", "socket", "folder"])
    if kind == "symlink":
        target.symlink_to(outside)
    elif kind == "loop":
        target.symlink_to(target.name)
    elif kind == "dangling":
        target.symlink_to(canary / "none")
    elif kind == "hard link":
        os.link(canary / "file", target)
    elif kind == "pipe":
        os.mkfifo(target)
    elif kind == "socket":
        here = os.getcwd()
        os.chdir(target.parent)
        socket.socket(socket.AF_UNIX).bind(target.name)
        os.chdir(here)
    else:
        target.mkdir()


def plant_sibling(rng, path, canary):
    """Where restarts are made, and where what they replace is put."""
    target = path.with_name("a.prt" + pick(rng, [".restart", ".replaced"]))
    kind = pick(rng, ["bake", "part of a bake", "mine", "file", "any"])
    if kind == "any":
        _plant(rng, target, canary)
    elif kind == "file":
        target.write_bytes(b"mine")
    else:
        shutil.copytree(canary / "bake.prt", target)
        if kind == "mine":
            (target / "notes.txt").write_bytes(b"mine")
        elif kind == "part of a bake":
            (target / "zarr.json").unlink()


def links_to_itself(rng, path, canary):
    """Hard links between files of the bake."""
    one, two = two_of(rng, files(path))
    two.unlink()
    os.link(one, two)


def permissions(rng, path, canary):
    target = pick(rng, [path, *arrays(path), *files(path)])
    os.chmod(target, pick(rng, [0, 0o400, 0o777]))


# Chunks that ask for much.


def _frame(size, content):
    """A zstd frame of zeros in blocks of 128 KiB, that says it decodes to `size` bytes."""
    head, blocks = struct.pack("<IBBQ", 0xFD2FB528, 0xC0, 0x70, size), b""
    while content:
        count = min(content, 1 << 17)
        content -= count
        blocks += (count << 3 | 2 | (not content)).to_bytes(3, "little") + b"\0"
    return head + (blocks or b"\1\0\0")


def bomb(rng, path, canary):
    """As it is, or with the digest that belongs there."""
    file = pick(rng, chunks(path))
    sizes = [0, 1, 1 << 20, 1 << 28, 5 << 30, (1 << 64) - 1]
    frame = _frame(pick(rng, sizes), pick(rng, [0, 1 << 20, 1 << 28]))
    array = next(p for p in file.parents if (p / "zarr.json").exists())
    if rng.random() < 0.5:
        store = BakeStore(path)
        inside = store.array(str(array.relative_to(path)))
        inside._chunks.keep(str(file.relative_to(array)), frame)
    else:
        file.write_bytes(frame)


# By somebody who knows how the store is sealed: then colours may differ, but never be NaN.


def forge_facts(rng, path, canary):
    store = BakeStore(path)
    attributes = store.attributes
    named = "compressed" if attributes.get("compressed") and rng.random() < 0.5 else None
    inside = attributes[named] if named else attributes
    values = [v for v in _VALUES if json.dumps(v)[:1] not in "NI" and v not in (2**63, 10**30)]
    values.remove("\ud800")
    _edit(rng, inside, lambda rng: pick(rng, values))
    write_attributes(store.files, {**attributes, "format": "prt bake", "version": 3})


# Arrays that lead to others, and what rays start from; and hits that mean something else than a
# point (see `transport.gather`).
_LEAD = "detail_", "point_ray_offset", "point_mean_albedo", "gather"
_CODES = -2, -3, -4, -20, -35, -36, -(1 << 31), (1 << 31) - 1, 0, 1, 255
_WRONG = np.nan, np.inf, -1, 2, 1e30, -1e38, 1e-38, 0.4, -1e-3


def _some_array(rng, store):
    """Its name, in the compressed form as well; every other time one that leads to others."""
    form = store.attributes.get("compressed")
    if form and rng.random() < 0.7:
        return f"{form['folder']}/{pick(rng, sorted(form['arrays']))}"
    names = store.names()
    leading = [name for name in names if name.startswith(_LEAD)]
    return pick(rng, leading if rng.random() < 0.5 else names)


def _seal(store, name):
    """Note the digest of an array that was forged, where one is noted."""
    attributes, (folder, _, name) = store.attributes, name.rpartition("/")
    if folder:
        form, digest = attributes["compressed"], store.array(f"{folder}/{name}").digest()
        store.update(compressed={**form, "arrays": {**form["arrays"], name: digest}})
    elif "arrays" in attributes:
        store.update(arrays={**attributes["arrays"], name: store.array(name).digest()})


def forge_array(rng, path, canary):
    """More or less of it, or in another order."""
    store = BakeStore(path, "r+")
    name = _some_array(rng, store)
    array = store.array(name)
    try:
        values = array.read()
    except PRTError as error:
        # Of a bake that was stopped not all parts are there.
        raise Nothing from error
    if not values.size:
        raise Nothing
    values = pick(rng, [values[:-1], np.concatenate([values, values]), values[::-1].copy()])
    store.create(name, values.shape, values.dtype, array._layout.chunks)[...] = values
    _seal(store, name)


def forge_values(rng, path, canary):
    """One in a chunk."""
    store = BakeStore(path, "r+")
    name = _some_array(rng, store)
    array, file = store.array(name), pick(rng, chunks(path / name))
    place = map(int, file.relative_to(path / name / "c").parts)
    part = tuple(
        slice(index * size, min(whole, (index + 1) * size))
        for index, size, whole in zip(place, array._layout.chunks, array.shape, strict=True)
    )
    values = array[part]
    value = pick(rng, _WRONG) if values.dtype.kind == "f" else np.int64(pick(rng, _CODES))
    values.ravel()[int(rng.integers(values.size))] = np.asarray(value).astype(values.dtype)
    array[part] = values
    _seal(store, name)


BYTES = [flip, truncate, extend, overwrite, delete, delete_folder]
PLACES = [swap_files, swap_chunks, copy_chunk, swap_arrays, swap_alike, rename, add_chunk,
          add_file, add_part]  # fmt: skip
JSON = [edit_facts, edit_description, edit_shape, malformed, huge_text, consolidated]
PLANTED = [plant, plant_beside, plant_sibling, links_to_itself, permissions, bomb]
FORGED = [forge_facts, forge_array, forge_values]
MUTATIONS = [*BYTES, *PLACES, *JSON, *PLANTED, *FORGED]
