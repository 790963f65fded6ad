"""A small bake to be damaged, and ways to damage it."""

import json
import os
import shutil
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, bake_steps, run
from prt_core.store import BakeStore
from prt_core.transport import detail_steps
from tests.meshes import ball_on_paint, caster_of

SETTINGS = BakeSettings(resolution=4, tolerance=0.05, caster="auto")
LAMPS = [Lamp("point", (1, 2, 3), (0, 0, 4), name="bulb")]
WORLD = np.random.default_rng(3).random((96, 3)).astype(np.float32)


# Points that are stored together, so that few points make several blocks.
BLOCK = 32


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(sys.modules["prt_core.bake.visibility"], "BLOCK", BLOCK)
    # Fuzzers set this in their own process: tests of other files have it as it is.
    monkeypatch.setattr("prt_core.store.journal.CHUNK", sys.modules["prt_core.store.journal"].CHUNK)


@pytest.fixture(scope="session")
def scene():
    """Of few points, for tests bake it often, but of all kinds: hidden ones, and details."""
    scene = ball_on_paint(rings=3, side=4, max_hidden=200)
    # All triangles have hidden points. Edges of others cost rays that no file keeps.
    assert scene.triangle_level.min() > 1 and len(scene.points) > 7 * BLOCK
    return scene


@pytest.fixture(scope="session")
def detailed(scene):
    """The scene as it is baked."""
    caster = caster_of(scene)
    result, _ = run(detail_steps(scene, caster, SETTINGS.seed))
    caster.close()
    assert len(result.details) > 1
    return result


@pytest.fixture(scope="session")
def finished(scene, tmp_path_factory):
    """A bake that no test changes."""
    path = tmp_path_factory.mktemp("bakes") / "a.prt"
    bake_in_small_blocks(scene, path, SETTINGS)
    return path


def bake_in_small_blocks(scene, path, settings):
    """For fixtures that are made before those of a test."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.modules["prt_core.bake.visibility"], "BLOCK", BLOCK)
        run(bake_steps(scene, path, settings, LAMPS, WORLD))


@pytest.fixture
def baked(finished, tmp_path):
    return shutil.copytree(finished, tmp_path / "a.prt")


@pytest.fixture
def quick_folder(tmp_path):
    """A folder in memory, where there is one: for tests of thousands of files."""
    memory = Path("/dev/shm")
    if not memory.is_dir():
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        yield Path(folder)


@pytest.fixture
def bake_again(scene):
    """Run the same bake again, on a path."""

    def again(path, settings=SETTINGS, **options):
        return run(bake_steps(scene, path, settings, LAMPS, WORLD, **options))

    return again


_READ = {}


def arrays(path):
    """All arrays of a bake, by name."""
    store = BakeStore(path)
    return {name: store.array(name).read() for name in store.names()}


def expect_same(path, other):
    """Fail unless two bakes hold the same arrays, bit by bit.

    The other is read once, as long as its attributes, which hold digests of all, stay the same.
    """
    facts = (other / "zarr.json").read_bytes()
    if facts not in _READ:
        _READ[facts] = arrays(other)
    one, two = arrays(path), _READ[facts]
    assert sorted(one) == sorted(two)
    for name, array in one.items():
        np.testing.assert_array_equal(array, two[name], err_msg=name)


def edit_text(path, change):
    """Edit the attributes as with a text editor."""
    meta = json.loads((path / "zarr.json").read_text())
    change(meta["attributes"])
    (path / "zarr.json").write_text(json.dumps(meta))


def forge_facts(path, **attributes):
    """Edit the attributes as this library does, with a new seal."""
    BakeStore(path, "r+").update(**attributes)


def forge_array(path, name, change):
    """Replace an array, with all digests as this library makes them."""
    store = BakeStore(path, "r+")
    array = store.array(name)
    values = change(array.read())
    built = store.create(name, values.shape, values.dtype)
    built[...] = values
    store.update(arrays={**store.attributes["arrays"], name: built.digest()})


def write_zeros(name):
    """Damage: an array of this library's making, but not of this bake's."""

    def damage(path):
        store = BakeStore(path, "r+")
        array = store.array(name)
        built = store.create(name, array.shape, array.dtype, array._layout.chunks)
        built[...] = array.read() * 0

    return damage


def unlink(name):
    return lambda path: (path / name).unlink()


def flip(name):
    def damage(path):
        data = bytearray((path / name).read_bytes())
        data[len(data) // 3] ^= 4
        (path / name).write_bytes(bytes(data))

    return damage


def cut(name):
    return lambda path: os.truncate(path / name, (path / name).stat().st_size // 2)


def shorter(name):
    def damage(path):
        meta = json.loads((path / name / "zarr.json").read_text())
        meta["shape"][0] -= 1
        (path / name / "zarr.json").write_text(json.dumps(meta))

    return damage


class Cut(Exception):
    """The power fails."""


@pytest.fixture
def counted(monkeypatch):
    """Counts the rays that the caster named `counted` casts, and fails after `limit` of them."""
    from prt_core.rays import caster as casters

    count = SimpleNamespace(rays=0, limit=np.inf)
    make = casters._FACTORIES["brute" if "embree" not in casters._FACTORIES else "embree"]

    def made(vertices, triangles):
        caster = make(vertices, triangles)
        for name in ("occluded", "intersect"):
            setattr(caster, name, _counting(getattr(caster, name), count))
        return caster

    monkeypatch.setitem(casters._FACTORIES, "counted", made)
    return count


def _counting(cast, count):
    def counting(origins, *rest):
        if count.rays >= count.limit:
            raise Cut
        count.rays += len(origins)
        return cast(origins, *rest)

    return counting


def swapped(one, two):
    """A change of a bake: two of its files, or folders, have changed places."""

    def damage(path):
        os.rename(path / one, path / "x")
        os.rename(path / two, path / one)
        os.rename(path / "x", path / two)

    return damage
