"""Points sampled tile by tile, and what does not fit into memory."""

import mmap
import sys

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, run
from prt_core.bake.memory import TILE, Memory
from prt_core.bake.pictures import Pictures, handed_out
from prt_core.bake.tile_rows import TileArrays, TileRows
from prt_core.runtime.machine import memory_bytes
from prt_core.sampling import Sampled
from prt_core.store import BakeStore
from tests.meshes import plane, sphere

ROW = 768


@pytest.fixture(scope="module")
def scene():
    ball = sphere(10, 0.4, (0, 0, 0.5), name="ball", albedo=(0.9, 0.3, 0.1))
    floor = plane(25, -1.2, 1.2, name="floor", albedo=0.7)
    return Scene.from_meshes([ball, floor], max_hidden=0)


def tiles_of_size(monkeypatch, size):
    monkeypatch.setattr(Memory, "tile_points", lambda self, n_points, row_bytes: size)


def is_mapped(array):
    """Whether an array is a view of a file."""
    while isinstance(array, np.ndarray):
        array = array.base
    return isinstance(array, mmap.mmap)


@pytest.mark.parametrize("tolerance", [0.03, 1e-6])
def test_the_certificate_holds_over_tiles(scene, tmp_path, monkeypatch, tolerance):
    tiles_of_size(monkeypatch, 200)
    # The smaller one is only met by asking again, and at last by tracing all.
    settings = BakeSettings(resolution=12, bounces=0, method="agreement", tolerance=tolerance)
    report = run(bake_steps(scene, tmp_path / "a.prt", settings))
    run(bake_steps(scene, tmp_path / "e.prt", BakeSettings(12, 0, method="exhaustive")))
    assert report["tolerance_met"] and report["sampling"]["tiles"] > 4
    assert (report["sampling"]["turns"] > 0) == (tolerance < 0.01)
    bake, truth = load(tmp_path / "a.prt"), load(tmp_path / "e.prt")
    sky = np.ones((bake.cube_map.n_directions, 3), np.float32)
    lit, wanted = (b.transport.radiance(sky) for b in (bake, truth))
    index = bake.scene.points.object_index
    for number, item in enumerate(report["certificate"]):
        mine = index == number
        error = np.linalg.norm((lit - wanted)[mine]) / np.linalg.norm(wanted[mine])
        assert error <= item["relit"]["even sky"]["high"] + 1e-6
    assert not [name for name in BakeStore(tmp_path / "a.prt").names() if name.startswith("tile")]


def test_a_bake_that_was_stopped_keeps_its_tiles_whatever_the_memory(scene, tmp_path, monkeypatch):
    tiles_of_size(monkeypatch, 200)
    settings = BakeSettings(resolution=6, method="agreement", tolerance=0.004)
    run(bake_steps(scene, tmp_path / "a.prt", settings))
    whole = BakeStore(tmp_path / "a.prt").attributes["arrays"]
    for stage in ("visibility", "certificate", "store"):
        path = tmp_path / f"{stage}.prt"
        tiles_of_size(monkeypatch, 200)
        steps = bake_steps(scene, path, settings)
        for progress in steps:
            if progress.stage == stage and progress.done:
                break
        steps.close()
        tiles_of_size(monkeypatch, 300)
        run(bake_steps(scene, path, settings))
        assert BakeStore(path).attributes["arrays"] == whole, stage


def test_tiles_that_are_there_stay_where_a_later_one_fails(scene, tmp_path, monkeypatch):
    tiles_of_size(monkeypatch, 200)
    module, calls = sys.modules["prt_core.bake.tiled"], []
    sample = module.sample_agreement

    def fails_at_the_third(*given, **more):
        calls.append(1)
        if len(calls) == 3:
            raise PRTError("no more")
        return sample(*given, **more)

    monkeypatch.setattr(module, "sample_agreement", fails_at_the_third)
    settings = BakeSettings(resolution=6, method="agreement", bounces=0)
    for _ in range(2):
        with pytest.raises(PRTError, match="no more"):
            run(bake_steps(scene, tmp_path / "a.prt", settings))
        calls.clear()
        calls += [1, 1]
    tiles = tmp_path / "a.prt" / "tile_bits0" / "c"
    assert sorted(path.name for path in tiles.iterdir()) == ["0", "1"]


def test_small_scenes_are_one_tile_and_large_ones_are_not():
    plenty = Memory(16 << 30)
    assert plenty.tile_points(60_000, ROW) == 60_000
    assert plenty.tile_points(1_000_000, ROW) == Memory(4 << 30).tile_points(10**7, ROW) == TILE
    few = Memory(1 << 28).tile_points(60_000, ROW)
    assert few < TILE and Memory(1 << 20).tile_points(60_000, ROW) <= few
    # Short rows are not all that a point takes.
    assert plenty.tile_points(10**7, 12) == TILE


@pytest.mark.parametrize("wrong", [0, -1, 0.1, float("nan"), float("inf"), "much", True, 1e6])
def test_memory_has_to_be_there(wrong, scene, tmp_path):
    with pytest.raises(PRTError, match="memory: expected"):
        run(bake_steps(scene, tmp_path / "a.prt", BakeSettings(4), memory=wrong))
    assert not (tmp_path / "a.prt").exists()


def test_memory_is_half_of_what_there_is_by_default():
    assert Memory.of().n_bytes == pytest.approx(max(memory_bytes() / 2, 5e8), rel=1e-6)
    assert Memory.of(1).n_bytes == 10**9


def test_bounces_from_files_are_those_from_memory(scene, tmp_path, monkeypatch):
    settings = BakeSettings(resolution=8, method="exhaustive", tolerance=0.02)
    one = run(bake_steps(scene, tmp_path / "a.prt", settings))
    plain = load(tmp_path / "a.prt")
    monkeypatch.setattr(Memory, "holds", lambda self, n_bytes: False)
    two = run(bake_steps(scene, tmp_path / "b.prt", settings))
    filed = load(tmp_path / "b.prt")
    assert one["error"] == two["error"]
    assert is_mapped(filed.transport.gather.data) and is_mapped(filed.transport.gather.indices)
    assert not is_mapped(plain.transport.gather.data)
    assert is_mapped(filed.transport.bits) and not is_mapped(plain.transport.bits)
    assert plain.transport.fingerprint() == filed.transport.fingerprint()
    sky = np.ones((plain.cube_map.n_directions, 3), np.float32)
    assert np.array_equal(*(b.transport.radiance(sky) for b in (plain, filed)))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.prt", "b.prt"]


def test_pictures_come_tile_by_tile(scene, tmp_path, monkeypatch):
    tiles_of_size(monkeypatch, 200)
    monkeypatch.setattr(sys.modules["prt_core.bake.pictures"], "_FIRST", 50)
    known, pictures = [], Pictures()
    settings = BakeSettings(resolution=8, method="agreement", tolerance=0.05)
    steps = bake_steps(scene, tmp_path / "a.prt", settings, pictures=pictures)
    run(handed_out(steps, pictures, lambda bake: known.append(bake.known_percent)))
    assert known[0] < 10 and known[-1] == 100
    assert any(10 < percent < 100 for percent in known)


def test_rows_of_tiles_are_indexed_as_an_array_is(tmp_path):
    rng, store = np.random.default_rng(2), BakeStore(tmp_path / "a.prt", "a")
    bits = rng.integers(0, 256, (90, 5), np.uint8)
    tiles = [np.sort(part) for part in np.array_split(rng.permutation(90), 4)]
    counts = ("rays", "open_points", "open_entries", "hemisphere_entries", "given_up", "first",
              "disagree", "check", "follow", "rest")  # fmt: skip
    attributes = {name: number for number, name in enumerate(counts)}
    first, second = (TileArrays.begun(store, turn, 4, 23, 5) for turn in (0, 1))
    for number, tile in enumerate(tiles):
        one = Sampled(bits[tile], bits[tile] & 1, 7, {}, {**attributes, "levels": [2, 3]})
        assert not first.holds(number)
        first.write(number, one)
        assert first.holds(number)
    rows = TileRows("bits", tiles, first, 1 << 20)
    assert rows.shape == bits.shape and len(rows) == 90
    points = rng.integers(0, 90, 200)
    byte = rng.integers(0, 5, 200)
    changed = np.array([3, 80, 41])
    for _ in range(2):
        assert np.array_equal(rows[points], bits[points])
        assert np.array_equal(rows[points, byte], bits[points, byte])
        assert np.array_equal(rows[5:40], bits[5:40])
        # Rows that are set, and those of another turn, take the place of others.
        rows[changed] = bits[changed] = rng.integers(0, 256, (3, 5), np.uint8)
        rows[changed[:1]] = bits[changed[:1]] = np.full((1, 5), 7, np.uint8)
    bits[tiles[2]] = 9
    second.write(2, Sampled(bits[tiles[2]], bits[tiles[2]], 1, {}, {**attributes, "levels": []}))
    rows.replace(2, tiles[2], second)
    assert np.array_equal(rows[points], bits[points])
    assert first.counts([0, 1])[:, 0].tolist() == [7, 7]
    TileArrays.remove(store)
    assert not store.names()
