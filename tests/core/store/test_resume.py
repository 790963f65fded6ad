"""A bake that was stopped or damaged goes on: what is whole is kept, the rest is made again."""

import os
import shutil
import sys
from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, bake_steps, load, run
from prt_core.store import BakeStore
from tests.core.store.conftest import (
    LAMPS,
    SETTINGS,
    WORLD,
    Cut,
    cut,
    edit_text,
    expect_same,
    flip,
    forge_facts,
    shorter,
    swapped,
    unlink,
    write_zeros,
)
from tests.meshes import ball_on_paint

COUNTED = replace(SETTINGS, caster="counted")
SAMPLED = BakeSettings(
    resolution=6, tolerance=0.05, bounces=0, method="agreement", caster="counted"
)


@pytest.mark.parametrize("stop", [2, 3, 5, 7, 9, 12])
def test_a_bake_that_was_stopped_goes_on_to_the_same_bytes(
    scene, finished, bake_again, tmp_path, stop
):
    path = tmp_path / "b.prt"
    steps = bake_steps(scene, path, SETTINGS, LAMPS, WORLD)
    for _ in range(stop):
        next(steps)
    steps.close()
    with pytest.raises(PRTError, match="not finished"):
        load(path)
    report = bake_again(path)
    expect_same(path, finished)
    # Some rays were cast before the clock was started: no speed is better than a wrong one.
    assert report["rays_per_second"] is None
    assert any("stopped and went on" in message for message in report["messages"])
    assert load(finished).report["rays_per_second"] > 0


def test_whose_a_bake_is_stands_in_its_first_facts(scene, tmp_path, monkeypatch):
    written, update = [], BakeStore.update

    def noted(store, **attributes):
        update(store, **attributes)
        written.append(store.attributes)

    monkeypatch.setattr(BakeStore, "update", noted)
    origin = {"file": "../a.blend", "scene": "S"}
    for _ in bake_steps(scene, tmp_path / "a.prt", SETTINGS, LAMPS, WORLD, origin=origin):
        if any("identity" in attributes for attributes in written):
            break
    named = [attributes.get("origin") for attributes in written if "identity" in attributes]
    assert named and all(result == origin for result in named)


def _remove_all_but(*kept):
    def change(path):
        for entry in list(path.iterdir()):
            if entry.name not in kept:
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

    return change


def _first_moments(path):
    _remove_all_but()(path)
    (path / f"zarr.json.{'0a' * 8}.part").write_bytes(b'{"zarr_')
    (path / f"zarr.{'0a' * 16}.partial").write_bytes(b"")


def _no_identity(path):
    _remove_all_but("zarr.json")(path)
    attributes = BakeStore(path).attributes
    keep = {key: attributes[key] for key in ("format", "version")}
    from prt_core.store.attributes import write_attributes

    write_attributes(BakeStore(path).files, {**keep, "complete": False})


@pytest.mark.parametrize("restart", [False, True, "changed"])
@pytest.mark.parametrize(
    "moment",
    [
        shutil.rmtree,
        _remove_all_but(),
        _remove_all_but("visibility", "point_albedo"),
        _first_moments,
        _no_identity,
    ],
)
def test_a_bake_that_was_killed_in_its_first_moments_is_begun(
    baked, finished, bake_again, moment, restart
):
    moment(baked)
    with pytest.raises(PRTError, match="no such bake|first moments|not finished"):
        load(baked)
    bake_again(baked, restart=restart)
    expect_same(baked, finished)
    assert [p.name for p in baked.parent.glob("*.prt*")] == ["a.prt"]
    assert not list(baked.rglob("*.part*"))


def test_facts_are_written_at_the_ends_of_stages_only(scene, tmp_path, monkeypatch):
    written = []
    from prt_core.store.files import Files

    write = Files.write

    def counting(self, key, data, lasting=False):
        written.append(key)
        write(self, key, data, lasting)

    monkeypatch.setattr(Files, "write", counting)
    monkeypatch.setattr(sys.modules["prt_core.bake.visibility"], "BLOCK", 16)
    run(bake_steps(scene, tmp_path / "b.prt", SETTINGS, LAMPS, WORLD))
    blocks = sum(key.startswith("visibility/c") for key in written)
    assert blocks > 10 and written.count("zarr.json") <= 7
    assert written[-1] == "zarr.json"


def unfinished(path):
    """As if the bake had been killed just before its end."""
    attributes = BakeStore(path).attributes
    assert attributes["complete"]
    forge_facts(path, complete=False)
    return path


# What is done to a bake, and the share of its rays that is cast again at most: all those of the
# details, and no others, where it is theirs.
BLOCK, DETAILS, NONE, ALL = 0.2, "details", 0.0, 1.0
DAMAGE = [
    (unlink("visibility/c/1/0"), BLOCK),
    (flip("visibility/c/1/0"), BLOCK),
    (cut("visibility/c/1/0"), BLOCK),
    (swapped("visibility/c/1/0", "visibility/c/2/0"), BLOCK),
    (swapped("visibility", "gather"), ALL),
    (unlink("visibility/zarr.json"), NONE),
    (flip("visibility/zarr.json"), NONE),
    (shorter("visibility"), NONE),
    (unlink("visibility_rays/c/1"), BLOCK),
    (flip("visibility_rays/c/1"), BLOCK),
    (swapped("gather/c/1/0", "gather/c/1/1"), BLOCK),
    (flip("gather/c/1/0"), BLOCK),
    (unlink("gather_rays/c/1/2/0"), BLOCK),
    (flip("gather_rays/c/1/2/0"), BLOCK),
    (shorter("gather"), NONE),
    (unlink("blocked/c/0"), NONE),
    (flip("point_albedo/c/0/0"), NONE),
    (flip("point_mean_albedo/c/0/0"), NONE),
    (write_zeros("point_mean_albedo"), NONE),
    (swapped("point_mean_albedo", "point_albedo"), NONE),
    (unlink("point_ray_offset/c/0/0"), NONE),
    (write_zeros("point_ray_offset"), NONE),
    (flip("scene_vertices/c/0/0"), NONE),
    (cut("detail_triangle/c/0"), DETAILS),
    (flip("detail_barycentric/c/0/0"), DETAILS),
    (write_zeros("detail_barycentric"), DETAILS),
    (unlink("detail_back/zarr.json"), DETAILS),
    (shorter("detail_point"), DETAILS),
    (unlink("detail_point/c/0"), DETAILS),
    (swapped("point_normals/c/0/0", "point_geometric_normals/c/0/0"), NONE),
    (swapped("point_normals", "point_areas"), NONE),
    (write_zeros("point_albedo"), NONE),
    (unlink("scene_lattice/zarr.json"), NONE),
    (flip("object_corner_point/c/0"), NONE),
    (shorter("point_positions"), NONE),
    (flip("world1/c/0/0"), NONE),
    (lambda path: shutil.rmtree(path / "scene_triangles"), NONE),
    (lambda path: shutil.rmtree(path / "visibility"), ALL),
    (lambda path: shutil.copyfile(path / "gather/c/1/0", path / "gather/c/1/5"), NONE),
    (lambda path: os.rename(path / "point_areas", path / "areas"), NONE),
]


@pytest.mark.parametrize(
    "damage, share, finish",
    [(*each, number % 2 == 0) for number, each in enumerate(DAMAGE)]
    + [(*DAMAGE[number], number % 2 == 1) for number in (0, 3, 8, 13, 26, 37)],
)
def test_what_is_damaged_is_made_again_and_nothing_else(
    scene, baked, finished, counted, damage, share, finish
):
    """Of a bake that is not finished, each other one, as well as of one that is."""
    if not finish:
        unfinished(baked)
    damage(baked)
    run(bake_steps(scene, baked, COUNTED, LAMPS, WORLD))
    shutil.rmtree(baked / "areas", ignore_errors=True)
    expect_same(baked, finished)
    load(baked)
    report = BakeStore(finished).attributes["report"]
    if share == DETAILS:
        assert counted.rays == report["rays_details"] > 0
    else:
        assert counted.rays <= share * report["rays"]
        assert counted.rays > 0 or share == NONE


def test_arrays_without_facts_are_gone_on_with(scene, baked, finished, counted):
    """Once it is known where the details are."""
    (baked / "zarr.json").unlink()
    report = run(bake_steps(scene, baked, COUNTED, LAMPS, WORLD))
    assert counted.rays == report["rays_details"] > 0
    expect_same(baked, finished)


@pytest.mark.parametrize("finish", [True, False])
def test_what_was_baked_of_other_details_is_baked_again(
    scene, baked, finished, counted, tmp_path, monkeypatch, finish
):
    """Another caster, or another version, may find others where those stored are damaged."""
    bake = sys.modules["prt_core.bake.steps"]

    def other(scene, caster, seed, steps=bake.detail_steps):
        return steps(scene, caster, seed + 1)

    monkeypatch.setattr(bake, "detail_steps", other)
    run(bake_steps(scene, tmp_path / "b.prt", SETTINGS, LAMPS, WORLD))
    assert load(tmp_path / "b.prt").scene.fingerprint() != load(finished).scene.fingerprint()
    if not finish:
        unfinished(baked)
    flip("detail_triangle/c/0")(baked)
    report = run(bake_steps(scene, baked, COUNTED, LAMPS, WORLD))
    assert counted.rays == report["rays"]
    expect_same(baked, tmp_path / "b.prt")


@pytest.mark.parametrize("restart", [False, True])
@pytest.mark.parametrize("name", [f"detail_{n}" for n in ("point", "triangle", "barycentric")])
def test_a_kill_between_the_arrays_of_details_costs_their_rays(
    scene, baked, finished, counted, monkeypatch, name, restart
):
    """In a new bake, and in one that will replace another."""
    if not restart:
        shutil.rmtree(baked)
    keep = BakeStore.keep

    def killed(store, key, array):
        keep(store, key, array)
        if key == name:
            raise Cut

    monkeypatch.setattr(BakeStore, "keep", killed)
    with pytest.raises(Cut):
        run(bake_steps(scene, baked, COUNTED, LAMPS, WORLD, restart=restart))
    monkeypatch.setattr(BakeStore, "keep", keep)
    if restart:
        expect_same(baked, finished)
    counted.rays = 0
    report = run(bake_steps(scene, baked, COUNTED, LAMPS, WORLD, restart=restart))
    assert counted.rays == report["rays"] and report["details"] > 0
    assert report["rays_details"] == load(finished).report["rays_details"]
    expect_same(baked, finished)
    assert [p.name for p in baked.parent.glob("*.prt*")] == ["a.prt"]


def test_a_bake_knows_whose_it_is_from_its_first_facts_on(scene, tmp_path):
    path, origin = tmp_path / "b.prt", {"file": "../x.blend", "scene": "Scene"}
    steps = bake_steps(scene, path, SETTINGS, LAMPS, origin=origin)
    while next(steps).stage != "details":
        pass
    steps.close()
    assert (
        BakeStore(path).attributes["origin"] == origin
        and "details" not in BakeStore(path).attributes
    )


def test_facts_that_were_forged_are_not_gone_on_with(baked, finished, bake_again):
    for attributes in ({"seconds": 7}, {"seconds": {"error": "long"}}, {"rays_details": "many"}):
        broken = shutil.copytree(finished, baked.with_name("b.prt"))
        forge_facts(unfinished(broken), **attributes)
        with pytest.raises(PRTError, match="again with --restart") as caught:
            bake_again(broken)
        assert "\n" not in str(caught.value) and str(broken) in str(caught.value)
        bake_again(broken, restart=True)
        expect_same(broken, finished)
        shutil.rmtree(broken)


def test_details_that_were_forged_are_found_again(scene, baked, finished, counted):
    """Digests and all, in a bake that goes on."""
    store = BakeStore(unfinished(baked), "r+")
    places = store.read("detail_barycentric")
    store.write("detail_barycentric", places / 2)
    report = run(bake_steps(scene, baked, COUNTED, LAMPS, WORLD))
    assert counted.rays == report["rays_details"]
    expect_same(baked, finished)


def test_a_sound_bake_goes_on_without_a_ray(scene, baked, finished, counted):
    unfinished(baked)
    run(bake_steps(scene, baked, COUNTED, LAMPS, WORLD))
    assert counted.rays == 0
    expect_same(baked, finished)


@pytest.mark.parametrize("name", ["visibility/c/1/0", "traced/c/0/0"])
def test_sampled_bits_that_are_damaged_are_sampled_again(tmp_path, counted, name):
    scene = ball_on_paint(0.0)  # all rays are of the visibility
    whole, broken = tmp_path / "a.prt", tmp_path / "b.prt"
    run(bake_steps(scene, whole, SAMPLED))
    rays = counted.rays
    shutil.copytree(whole, broken)
    flip(name)(broken)
    run(bake_steps(scene, broken, SAMPLED))
    assert counted.rays == 2 * rays
    expect_same(broken, whole)


@pytest.mark.parametrize("damage", [flip, cut, unlink])
def test_a_damaged_part_of_the_journal_is_cast_again(tmp_path, counted, monkeypatch, damage):
    scene = ball_on_paint(0.0)  # all rays are of the visibility
    monkeypatch.setattr("prt_core.store.journal.CHUNK", 4096)
    whole, broken = tmp_path / "a.prt", tmp_path / "b.prt"
    run(bake_steps(scene, whole, SAMPLED))
    rays, counted.limit, counted.rays = counted.rays, 0.7 * counted.rays, 0
    with pytest.raises(Cut):
        run(bake_steps(scene, broken, SAMPLED))
    damage("ray_journal/c/1/0")(broken)
    counted.limit = np.inf
    run(bake_steps(scene, broken, SAMPLED))
    assert rays + 4096 <= counted.rays <= rays + 3 * 4096
    expect_same(broken, whole)


def test_a_journal_that_a_kill_left_behind_goes(scene, tmp_path, counted):
    whole, path = tmp_path / "a.prt", tmp_path / "b.prt"
    run(bake_steps(scene, whole, SAMPLED))
    rays = counted.rays
    store = BakeStore(unfinished(shutil.copytree(whole, path)), "r+")
    store.create("ray_journal", (7, 5), "uint8", (1, 5))[0] = 3
    run(bake_steps(scene, path, SAMPLED))
    expect_same(path, whole)
    assert counted.rays == rays


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda f: f["settings"].update(bounces=0), "damaged or edited; bake again with --restart"),
        (lambda f: f["identity"].update(resolution=5), "damaged or edited"),
        (lambda f: f.update(complete=True), "damaged or edited"),
    ],
)
def test_edited_facts_are_not_gone_on_with(baked, finished, bake_again, change, message):
    unfinished(baked)
    edit_text(baked, change)
    with pytest.raises(PRTError, match=message):
        bake_again(baked)
    bake_again(baked, restart=True)
    expect_same(baked, finished)


@pytest.mark.parametrize("stop", [4, 9, 14])
def test_a_folder_that_is_removed_in_mid_bake_ends_it_and_the_next_works(
    scene, finished, bake_again, tmp_path, stop
):
    path = tmp_path / "b.prt"
    steps = bake_steps(scene, path, SETTINGS, LAMPS, WORLD)
    for _ in range(stop):
        next(steps)
    shutil.rmtree(path)
    with pytest.raises(PRTError, match="was removed|removed this bake|is missing|lacks") as caught:
        run(steps)
    assert "\n" not in str(caught.value)
    assert not path.exists()
    bake_again(path)
    expect_same(path, finished)


def test_a_caster_that_cannot_be_made_leaves_no_folder(scene, tmp_path):
    with pytest.raises(PRTError, match="caster"):
        run(bake_steps(scene, tmp_path / "b.prt", replace(SETTINGS, caster="none")))
    assert not (tmp_path / "b.prt").exists()
