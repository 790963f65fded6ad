"""What a finished bake holds, and that nothing else is taken for one."""

import json
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, Camera, PRTError, Scene, bake_steps, load, run
from prt_core.cli import main
from prt_core.light import EnvironmentMap
from prt_core.light.baked_world import BakedWorld
from prt_core.store import BakeStore, read_scene, write_scene
from tests.core.store.conftest import (
    LAMPS,
    SETTINGS,
    WORLD,
    edit_text,
    expect_same,
    forge_array,
    forge_facts,
    swapped,
    write_zeros,
)
from tests.meshes import plane


def test_what_is_loaded_is_what_was_baked(detailed, finished):
    bake, scene = load(finished), detailed
    for name, array in scene.points.arrays().items():
        np.testing.assert_array_equal(bake.scene.points.arrays()[name], array)
    for name in ("vertices", "triangles", "lattice", "lattice_back", "triangle_level"):
        np.testing.assert_array_equal(getattr(bake.scene, name), getattr(scene, name))
    for name in ("point", "triangle", "barycentric", "back"):
        result, wanted = (getattr(one.details, name) for one in (bake.scene, scene))
        np.testing.assert_array_equal(result, wanted)
    assert bake.scene.fingerprint() == scene.fingerprint()
    assert bake.transport.mean_albedo is not None
    assert bake.lamps[0].name == "bulb"
    np.testing.assert_array_equal(bake.world, WORLD)
    report = bake.report
    assert report["points"] == len(scene.points)
    kinds = "rays_visibility", "rays_details", "rays_emission", "rays_gather", "rays_short"
    assert report["rays"] == sum(report[kind] for kind in kinds)
    assert report["bytes"] > 0 and 0 <= report["error"] < 1
    colours = bake.colours(bake.transport.radiance(np.ones((96, 3), np.float32)))
    assert colours["plane"].shape == (36, 3) and colours["plane"].dtype == np.float32


def test_zarr_reads_what_is_written(finished):
    """The folder is a Zarr v3 group for others as well."""
    import zarr

    group = zarr.open_group(str(finished), mode="r")
    store = BakeStore(finished)
    assert group.attrs["format"] == "prt bake" and len(store.names()) > 20
    for name in store.names():
        np.testing.assert_array_equal(group[name][...], store.read(name), err_msg=name)


def test_a_finished_bake_is_not_touched_again(baked, bake_again):
    before = {p: p.stat().st_mtime_ns for p in baked.rglob("*") if p.is_file()}
    bake_again(baked)
    assert {p: p.stat().st_mtime_ns for p in baked.rglob("*") if p.is_file()} == before


def test_new_lamps_and_world_are_taken_without_a_ray(scene, baked, finished):
    attributes = BakeStore(baked).attributes
    for world in (WORLD[::-1].copy(), None, WORLD):
        run(bake_steps(scene, baked, SETTINGS, LAMPS * 2, world, Camera(np.eye(4), 1)))
        bake = load(baked)
        assert len(bake.lamps) == 2 and bake.camera == Camera(np.eye(4), 1)
        np.testing.assert_array_equal(bake.world, world)
        assert len(list(baked.glob("world*"))) == (world is not None)
    assert BakeStore(baked).attributes["report"] == attributes["report"]


def test_an_image_of_the_world_is_kept_beside_it(scene, baked):
    pixels = np.random.default_rng(2).random((8, 16, 3)).astype(np.float32)
    for image in (pixels, 2 * pixels, None, pixels):
        kept = BakedWorld(WORLD, None if image is None else EnvironmentMap(image))
        run(bake_steps(scene, baked, SETTINGS, LAMPS, kept))
        bake = load(baked)
        np.testing.assert_array_equal(bake.world, WORLD)
        assert (bake.world_image is None) == (image is None)
        if image is not None:
            np.testing.assert_array_equal(bake.world_image.pixels, image)
        assert len(list(baked.glob("world*"))) == 1 + (image is not None)
    before = {p: p.stat().st_mtime_ns for p in baked.rglob("*") if p.is_file()}
    run(bake_steps(scene, baked, SETTINGS, LAMPS, kept))
    after = {p: p.stat().st_mtime_ns for p in baked.rglob("*") if p.is_file()}
    assert {p: t for p, t in after.items() if "world" in str(p)} == {
        p: t for p, t in before.items() if "world" in str(p)
    }
    forge_facts(baked, world_image="world_image7")
    with pytest.raises(PRTError, match="the name of its world's image"):
        load(baked)


def test_a_kill_before_new_lights_are_named_leaves_the_old_ones(scene, baked, monkeypatch):
    monkeypatch.setattr(BakeStore, "update", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run(bake_steps(scene, baked, SETTINGS, LAMPS, WORLD[::-1].copy()))
    monkeypatch.undo()
    np.testing.assert_array_equal(load(baked).world, WORLD)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"world": WORLD[:-1]}, "world: expected an array of shape \\(96, 3\\)"),
        ({"world": WORLD * np.nan}, "world: 288 values are NaN"),
        ({"world": WORLD + 1e30}, "world: expected values from 0 to 1e\\+15"),
        ({"camera": {"matrix": np.eye(4)}}, "camera: expected a Camera, got"),
        ({"lamps": ["bulb"]}, "lamps: expected a list of lamps"),
    ],
)
def test_what_could_not_be_read_again_is_not_baked(scene, tmp_path, parts, message):
    with pytest.raises(PRTError, match=message):
        run(bake_steps(scene, tmp_path / "a.prt", SETTINGS, **parts))
    assert not (tmp_path / "a.prt").exists()


def test_another_scene_or_setting_is_refused(scene, baked):
    other = Scene.from_meshes([plane(5)])
    with pytest.raises(PRTError, match="another scene"):
        run(bake_steps(other, baked, SETTINGS))
    with pytest.raises(PRTError, match="another resolution.*--restart"):
        run(bake_steps(scene, baked, replace(SETTINGS, resolution=5)))


def test_direct_only_bakes_no_gather(scene, tmp_path):
    settings = BakeSettings(resolution=4, bounces=0, caster="auto")
    report = run(bake_steps(scene, tmp_path / "d.prt", settings))
    assert report["rays_gather"] == 0
    assert load(tmp_path / "d.prt").transport.gather is None


def test_a_scene_reads_back_bit_by_bit(detailed, tmp_path):
    store = BakeStore(tmp_path / "s.prt", "a")
    store.update(**write_scene(store, detailed))
    assert read_scene(BakeStore(tmp_path / "s.prt")).fingerprint() == detailed.fingerprint()


def _truncate(path):
    chunk = path / "visibility" / "c" / "1" / "0"
    chunk.write_bytes(chunk.read_bytes()[:-7])


def _flip(name):
    def damage(path):
        chunk = path / name / "c" / "0" / "0"
        data = bytearray(chunk.read_bytes())
        data[len(data) // 2] ^= 1
        chunk.write_bytes(bytes(data))

    return damage


def _copy(source, target):
    return lambda path: shutil.copyfile(path / source, path / target)


def _link(path):
    target = path.parent / "outside"
    shutil.move(path / "visibility", target)
    (path / "visibility").symlink_to(target)


def _array_text(name, change):
    def damage(path):
        file = path / name / "zarr.json"
        meta = json.loads(file.read_text())
        change(meta)
        file.write_text(json.dumps(meta))

    return damage


def _attributes(change):
    return lambda path: edit_text(path, change)


def _old(path):
    edit_text(path, lambda attributes: attributes.update(version=2))


@pytest.mark.parametrize(
    "damage, message",
    [
        (_truncate, "'visibility' cannot be read: a part of it"),
        (_flip("gather"), "'gather' cannot be read: a part of it"),
        (_flip("point_albedo"), "'point_albedo' cannot be read"),
        (lambda p: (p / "point_albedo/c/0/0").unlink(), "'point_albedo' lacks 1 of its parts"),
        (lambda p: (p / "gather/c/1/1").unlink(), "'gather' lacks 1 of its parts"),
        (lambda p: (p / "blocked/c/0").unlink(), "'blocked' lacks 1 of its parts"),
        (swapped("visibility/c/0/0", "visibility/c/1/0"), "'visibility' cannot be read"),
        (swapped("point_normals", "point_geometric_normals"), "'point_normals' cannot be read"),
        (swapped("gather/c/0/0", "gather/c/0/1"), "'gather' cannot be read"),
        (_copy("gather/c/0/0", "gather/c/0/7"), "outside its shape"),
        (write_zeros("point_albedo"), "'point_albedo' is not what the bake was finished with"),
        (write_zeros("gather"), "'gather' is not what the bake was finished with"),
        (_link, "is a symbolic link"),
        (lambda p: os.mkfifo(p / "visibility/c/99"), "is a pipe"),
        (_array_text("point_albedo", lambda m: m["codecs"].append({"name": "gzip"})), "in a way"),
        (_array_text("point_albedo", lambda m: m.update(shape=[10**12, 3])), "in a way"),
        (_array_text("point_albedo", lambda m: m.update(shape=[10**9, 3])), "lacks|is \\("),
        (_array_text("point_albedo", lambda m: m.update(data_type="object")), "in a way"),
        (_array_text("point_albedo", lambda m: m.update(fill_value=1)), "in a way"),
        (_array_text("point_albedo", lambda m: m.update(shape=[[1], 3])), "in a way"),
        (
            _attributes(lambda f: f.update(version=99)),
            "store version 99, this library reads 3; update",
        ),
        (_attributes(lambda f: f.update(format="other")), "is not a bake"),
        (_attributes(lambda f: f.update(complete=False)), "was damaged or edited"),
        (_attributes(lambda f: f["settings"].update(bounces=0)), "was damaged or edited"),
        (_attributes(lambda f: f["report"].update(points=1)), "was damaged or edited"),
        (_old, "older version of this library; bake again with --restart"),
        (lambda p: shutil.rmtree(p / "point_normals"), "'point_normals' is missing"),
        (lambda p: (p / "zarr.json").write_text("{"), "cannot be read"),
        (lambda p: (p / "zarr.json").unlink(), "in its first moments"),
        (lambda p: shutil.rmtree(p), "there is no such bake"),
        (lambda p: forge_facts(p, complete=False), "not finished"),
    ],
)
def test_damage_gives_one_clear_line(baked, damage, message):
    damage(baked)
    with pytest.raises(PRTError, match=message) as caught:
        load(baked)
    assert "\n" not in str(caught.value) and str(baked) in str(caught.value)


def _changed(index, value):
    def change(array):
        array[index] = value
        return array

    return change


@pytest.mark.parametrize(
    "name, change, message",
    [
        ("point_albedo", _changed((3, 1), 65), "'albedo' are not finite, not distinct or out of"),
        ("point_normals", _changed(5, 1e30), "'normals' are not finite"),
        ("point_normals", _changed(5, 0.5), "'normals' are not finite"),
        ("point_positions", _changed((2, 0), np.nan), "'positions' are not finite"),
        ("point_areas", _changed(2, -1), "'areas' are not finite"),
        ("point_object_index", _changed(2, 7), "indices do not fit"),
        ("scene_lattice", lambda a: np.full_like(a, 10**6), "indices do not fit"),
        ("scene_triangle_level", _changed(0, 0), "indices do not fit"),
        ("object_face_sizes", _changed(0, -3), "indices do not fit"),
        ("blocked", _changed(1, 2), "'blocked' is out of range"),
        ("blocked", _changed(1, np.nan), "'blocked' is out of range"),
        ("point_positions", _changed((2, 0), 0.6), "'positions' are not finite"),
        ("point_ray_offset", lambda a: 100 * a, "'ray_offset' are not finite"),
        ("point_ray_offset", lambda a: -a, "'ray_offset' are not finite"),
        ("point_ray_offset", lambda a: 0 * a, "'ray_offset' are not finite"),
        ("point_ray_offset", _changed((7, 1), np.nan), "'ray_offset' are not finite"),
        ("point_mean_albedo", _changed((3, 1), 1.1), "'mean_albedo' are not finite"),
        ("point_mean_albedo", _changed((3, 1), -0.1), "'mean_albedo' are not finite"),
        ("detail_triangle", _changed(1, 248), "indices do not fit"),
        ("detail_triangle", _changed(1, -1), "indices do not fit"),
        ("detail_barycentric", _changed((1, 0), -0.1), "indices do not fit"),
        ("detail_barycentric", _changed(1, 0.6), "indices do not fit"),
        ("detail_barycentric", _changed((1, 1), np.nan), "indices do not fit"),
        ("detail_back", _changed(1, True), "indices do not fit"),
        ("detail_point", _changed(1, 10**6), "indices do not fit"),
        ("detail_point", lambda a: a[:-1], "'detail_triangle' is \\("),
        ("gather", _changed((4, 2), 10**8), r"hits: expected values <= \d+, got 1e\+08"),
        ("gather", _changed((4, 2), -3), "hits: expected points"),
        # Of the 32 rays of a round only those are stood for that were cast.
        ("gather", _changed((4, 2), -4 - 31 - 1), "hits: expected points"),
        ("gather", _changed((4, 2), -4 - 2), "hits: expected points"),
        ("gather", _changed((4, [2, 3]), [-4 - 3, -4 - 5]), "hits: expected points"),
        ("gather", _changed((4, 2), -(1 << 31)), "hits: expected points"),
        ("world1", _changed((4, 2), np.inf), "world: 1 values are NaN or infinite"),
        ("visibility", lambda a: a[:-1], "'visibility' is \\("),
        ("point_emission", _changed((4, 2), -1.0), "its 'emission' are not finite"),
        ("point_emitter", _changed(4, 7), "its indices do not fit"),
        ("scene_triangle_emitter", _changed(4, -2), "its indices do not fit"),
        ("emission_direct", _changed((0, 4, 3), -1.0), "'emission_direct' is out of range"),
        ("emission_received", _changed((0, 4, 5), np.nan), "'emission_received' is out of range"),
        ("emission_received", lambda a: a[:, :-1], "'emission_received' is \\("),
    ],
)
def test_values_are_checked_where_the_digests_were_forged(baked, name, change, message):
    forge_array(baked, name, change)
    with pytest.raises(PRTError, match=message) as caught:
        load(baked)
    assert "\n" not in str(caught.value) and str(baked) in str(caught.value)


@pytest.mark.parametrize(
    "attributes",
    [
        {"settings": {"resolution": "many"}},
        {"settings": None},
        {"settings": {"resolution": 4, "tolerance": -1}},
        {"rounds": True},
        {"rounds": 400},
        {"objects": [{"name": "x"}]},
        {"objects": {}},
        {"objects": 7},
        {"size": 0},
        {"size": "4"},
        {"centre": [1, 2]},
        {"centre": [1, 2, None]},
        {"lamps": [{"kind": "torch"}]},
        {"lamps": [{"kind": "point", "power": [1, 2, 3], "radius": "wide"}]},
        {"lamps": 3},
        {"camera": []},
        {"camera": {"matrix": [[0] * 4] * 4, "tangent": 0}},
        {"source": [1]},
        {"world": "../world1"},
        {"world": 5},
        {"image": [3, 5]},
        {"report": None},
        {"arrays": None},
        {"arrays": {}},
        {"identity": 4},
        {"emitters": "ball"},
        {"emitters": ["ball", "ball"]},
        {"emitters": [3]},
        {"emitters": []},
    ],
)
def test_forged_facts_give_one_clear_line(baked, attributes):
    forge_facts(baked, **attributes)
    with pytest.raises(PRTError) as caught:
        load(baked)
    assert "\n" not in str(caught.value) and str(baked) in str(caught.value)


@pytest.mark.parametrize("key", [f"n_{what}" for what in ("corners", "faces", "vertices")])
@pytest.mark.parametrize("value", [-5, 10**9, 2.0, True, "7", None])
def test_forged_objects_give_one_clear_line(baked, key, value):
    objects = BakeStore(baked).attributes["objects"]
    objects[1][key] = value
    forge_facts(baked, objects=objects)
    with pytest.raises(PRTError) as caught:
        load(baked)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "damage, code, message",
    [
        (lambda p: None, 0, "points"),
        (lambda p: forge_facts(p, complete=False), 0, "not finished; the same 'prt bake' goes on"),
        (_truncate, 2, "'visibility' cannot be read"),
        (lambda p: (p / "world1/c/0/0").unlink(), 2, "'world1' lacks 1 of its parts"),
        (lambda p: (p / "zarr.json").write_text("{"), 2, "cannot be read"),
        (lambda p: (p / "zarr.json").unlink(), 2, "stopped in its first moments"),
        (_old, 2, "older version"),
        (lambda p: forge_facts(p, report={}), 2, "its report is damaged"),
        (lambda p: forge_facts(p, compressed={"folder": 3}), 2, "compressed form is damaged"),
    ],
)
@pytest.mark.parametrize("json_wanted", [False, True])
def test_info_says_what_is_wrong_in_one_line(baked, capsys, damage, code, message, json_wanted):
    damage(baked)
    result = main(["info", str(baked), *(["--json"] if json_wanted else [])])
    out, err = capsys.readouterr()
    if json_wanted and "report" in message:
        assert result == 0
        return
    assert result == code
    if code:
        assert out == "" and len(err.splitlines()) == 1 and message in err
    elif not json_wanted:
        assert message in out


def test_what_is_unknown_in_the_folder_is_left_alone(baked, finished, bake_again):
    (baked / "notes.txt").write_text("mine")
    (baked / ".DS_Store").write_bytes(b"\0")
    load(baked)
    bake_again(baked)
    assert (baked / "notes.txt").read_text() == "mine"
    (baked / "notes.txt").unlink()
    expect_same(baked, finished)


def test_two_writers_do_not_undo_each_other(baked):
    one, two = BakeStore(baked, "r+"), BakeStore(baked, "r+")
    one.update(note=1)
    with pytest.raises(PRTError, match="another program changed or removed this bake"):
        two.update(note=2)
    assert BakeStore(baked).attributes["note"] == 1
