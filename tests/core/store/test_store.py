import json
import os
import shutil

import numpy as np
import pytest

from prt_core import BakeSettings, Lamp, PRTError, Scene, bake_steps, load, run
from prt_core.store import BakeStore, read_scene
from tests.meshes import plane, sphere

SETTINGS = BakeSettings(resolution=4, tolerance=0.05, caster="auto")


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    import sys

    monkeypatch.setattr(sys.modules["prt_core.bake_visibility"], "BLOCK", 64)


@pytest.fixture
def scene():
    ball = sphere(6, 0.5, (0, 0, 0.6), name="ball", albedo=(0.9, 0.3, 0.1))
    return Scene.from_meshes([ball, plane(9, albedo=0.7)])


@pytest.fixture
def baked(scene, tmp_path):
    path = tmp_path / "a.prt"
    lamp = Lamp("point", (1, 2, 3), (0, 0, 4), name="bulb")
    run(bake_steps(scene, path, SETTINGS, [lamp]))
    return path


def digest(path):
    arrays = {}
    for name in ("visibility", "gather", "visibility_rays", "gather_rays"):
        arrays[name] = BakeStore(path).read(name)
    return arrays


def test_what_is_loaded_is_what_was_baked(scene, baked):
    bake = load(baked)
    for name, array in scene.points.arrays().items():
        np.testing.assert_array_equal(bake.scene.points.arrays()[name], array)
    for name in ("vertices", "triangles", "lattice", "lattice_back", "triangle_level"):
        np.testing.assert_array_equal(getattr(bake.scene, name), getattr(scene, name))
    assert bake.scene.fingerprint() == scene.fingerprint()
    assert bake.lamps[0].name == "bulb"
    report = bake.report
    assert report["points"] == len(scene.points)
    assert report["rays"] == report["rays_visibility"] + report["rays_gather"]
    assert report["bytes"] > 0 and 0 <= report["error"] < 1
    colours = bake.colours(bake.transport.relight(np.ones((96, 3), np.float32)))
    assert colours["plane"].shape == (256, 3) and colours["plane"].dtype == np.float32


@pytest.mark.parametrize("stop", [1, 2, 3, 5, 7, 9, 12])
def test_a_bake_that_was_stopped_goes_on_to_the_same_bytes(scene, baked, tmp_path, stop):
    path = tmp_path / "b.prt"
    steps = bake_steps(scene, path, SETTINGS)
    for _ in range(stop):
        next(steps)
    steps.close()
    with pytest.raises(PRTError, match="not finished"):
        load(path)
    run(bake_steps(scene, path, SETTINGS))
    whole, resumed = digest(baked), digest(path)
    for name in whole:
        np.testing.assert_array_equal(whole[name], resumed[name], err_msg=name)


def test_a_finished_bake_is_not_traced_again(scene, baked):
    before = os.stat(baked / "visibility" / "c" / "0" / "0").st_mtime_ns
    run(bake_steps(scene, baked, SETTINGS))
    assert os.stat(baked / "visibility" / "c" / "0" / "0").st_mtime_ns == before


def test_another_scene_or_setting_is_refused_and_restart_replaces(scene, baked):
    other = Scene.from_meshes([plane(5)])
    with pytest.raises(PRTError, match="another scene"):
        run(bake_steps(other, baked, SETTINGS))
    finer = BakeSettings(resolution=5, tolerance=0.05, caster="auto")
    with pytest.raises(PRTError, match="another resolution.*--restart"):
        run(bake_steps(scene, baked, finer))
    run(bake_steps(other, baked, SETTINGS, restart=True))
    assert len(load(baked).scene.points) == len(other.points)


def test_direct_only_bakes_no_gather(scene, tmp_path):
    settings = BakeSettings(resolution=4, bounces=0, caster="auto")
    report = run(bake_steps(scene, tmp_path / "d.prt", settings))
    assert report["rays_gather"] == 0
    assert load(tmp_path / "d.prt").transport.gather is None


def _edit(path, **attributes):
    meta = json.loads((path / "zarr.json").read_text())
    meta["attributes"].update(attributes)
    (path / "zarr.json").write_text(json.dumps(meta))


def _truncate(path):
    chunk = path / "visibility" / "c" / "1" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-7])


def _flip(path):
    chunk = path / "gather" / "c" / "0" / "0"
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(bytes(data))


def _link(path):
    target = path.parent / "outside"
    shutil.move(path / "visibility", target)
    (path / "visibility").symlink_to(target)


def _codec(path):
    file = path / "point_albedo" / "zarr.json"
    meta = json.loads(file.read_text())
    meta["codecs"].append({"name": "gzip", "configuration": {"level": 1}})
    file.write_text(json.dumps(meta))


def _wrong_index(path):
    store = BakeStore(path, "a")
    store.write("scene_lattice", np.full_like(store.read("scene_lattice"), 10**6))


@pytest.mark.parametrize(
    "damage, message",
    [
        (_truncate, "'visibility' cannot be read"),
        (_flip, "'gather' cannot be read"),
        (_link, "symbolic link"),
        (_codec, "'point_albedo' is described in a way"),
        (_wrong_index, "indices do not fit"),
        (lambda p: _edit(p, version=99), "store version 99"),
        (lambda p: _edit(p, format="other"), "is not a bake"),
        (lambda p: _edit(p, complete=False), "not finished"),
        (lambda p: _edit(p, objects=[{"name": "x"}]), "description is damaged"),
        (lambda p: shutil.rmtree(p / "point_normals"), "'point_normals' is missing"),
        (lambda p: (p / "zarr.json").write_text("{"), "cannot be read"),
        (lambda p: shutil.rmtree(p), "there is no such bake"),
    ],
)
def test_damage_gives_one_clear_line(baked, damage, message):
    damage(baked)
    with pytest.raises(PRTError, match=message) as caught:
        load(baked)
    assert "\n" not in str(caught.value) and str(baked) in str(caught.value)


def test_a_folder_that_is_no_bake_is_never_removed(tmp_path, scene):
    folder = tmp_path / "precious"
    folder.mkdir()
    (folder / "work.txt").write_text("mine")
    with pytest.raises(PRTError, match="is not a bake"):
        run(bake_steps(scene, folder, SETTINGS, restart=True))
    assert (folder / "work.txt").read_text() == "mine"


def test_a_store_reads_back_bit_by_bit(scene, tmp_path):
    from prt_core.store import write_scene

    store = BakeStore(tmp_path / "s.prt", "a")
    write_scene(store, scene)
    assert read_scene(BakeStore(tmp_path / "s.prt")).fingerprint() == scene.fingerprint()
