"""A bake that replaces another is made beside it; nothing is lost before it is finished."""

import os
import shutil
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, compress, load, run
from prt_core.bake.measure import standing_lights
from prt_core.store import BakeStore, begin_bake, finish_bake, remove_bake
from tests.core.store.conftest import (
    LAMPS,
    SETTINGS,
    WORLD,
    Cut,
    bake_in_small_blocks,
    expect_same,
    forge_facts,
)
from tests.meshes import plane

COUNTED = replace(SETTINGS, caster="counted")


@pytest.fixture(scope="session")
def other():
    return Scene.from_meshes([plane(5), plane(3, -0.3, 0.3, name="roof", z=0.4)], max_hidden=300)


@pytest.fixture(scope="session")
def another(other, tmp_path_factory):
    """A finished bake of the other scene."""
    path = tmp_path_factory.mktemp("another") / "b.prt"
    bake_in_small_blocks(other, path, replace(SETTINGS, seed=3))
    return path


def beside(path):
    return sorted(entry.name for entry in path.parent.glob("*.prt*"))


def test_a_restart_replaces_what_is_there(baked, other, another):
    run(bake_steps(other, baked, replace(SETTINGS, seed=3), LAMPS, WORLD, restart=True))
    expect_same(baked, another)
    assert beside(baked) == ["a.prt"]


@pytest.mark.parametrize(
    "settings", [{"seed": -1}, {"seed": 1 << 70}, {"seed": 0.5}, {"resolution": 0}]
)
def test_settings_are_checked_before_anything_is_touched(baked, finished, scene, settings):
    with pytest.raises(PRTError, match="seed: expected a whole number|resolution"):
        run(bake_steps(scene, baked, BakeSettings(**settings), restart=True))
    expect_same(baked, finished)


@pytest.mark.parametrize("restart", [True, "changed"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_the_old_bake_stays_until_the_new_one_is_finished(
    baked, finished, other, another, counted, restart, share
):
    settings = replace(COUNTED, seed=3)
    compress(baked, method="harmonics", tolerance=0.3, lights=standing_lights())
    lit = load(baked).transport.radiance(WORLD)
    whole = load(another).report["rays"]
    counted.limit = share * whole
    with pytest.raises(Cut):
        run(bake_steps(other, baked, settings, LAMPS, WORLD, restart=restart))
    np.testing.assert_array_equal(load(baked).transport.radiance(WORLD), lit)
    assert "compressed" in BakeStore(baked).attributes
    # The same again goes on where it was; then the compressed form of the old bake is gone too.
    counted.limit = np.inf
    run(bake_steps(other, baked, settings, LAMPS, WORLD, restart=restart))
    assert counted.rays < 1.3 * whole
    expect_same(baked, another)
    assert beside(baked) == ["a.prt"] and not list(baked.glob("compressed*"))
    assert "compressed" not in BakeStore(baked).attributes


def test_a_restart_of_another_scene_does_not_go_on_with_the_last_one(
    baked, scene, finished, other, counted
):
    counted.limit = 500
    with pytest.raises(Cut):
        run(bake_steps(other, baked, COUNTED, restart=True))
    counted.limit = np.inf
    run(bake_steps(scene, baked, SETTINGS, LAMPS, WORLD, restart=True))
    expect_same(baked, finished)
    assert beside(baked) == ["a.prt"]


def test_changed_leaves_a_bake_that_is_not(baked, finished, bake_again):
    before = os.stat(baked / "zarr.json").st_mtime_ns
    bake_again(baked, restart="changed")
    assert os.stat(baked / "zarr.json").st_mtime_ns == before


def test_a_restart_where_nothing_was_goes_on_with_and_without_the_word(
    tmp_path, scene, finished, bake_again, counted
):
    path = tmp_path / "new.prt"
    counted.limit = 0.9 * load(finished).report["rays"]
    with pytest.raises(Cut):
        run(bake_steps(scene, path, COUNTED, LAMPS, WORLD, restart=True))
    rays, counted.limit = counted.rays, np.inf
    shutil.copytree(path.with_name("new.prt.restart"), tmp_path / "kept")
    for restart in (False, True):
        counted.rays = rays
        run(bake_steps(scene, path, COUNTED, LAMPS, WORLD, restart=restart))
        assert counted.rays < 1.1 * load(finished).report["rays"]
        expect_same(path, finished)
        remove_bake(path)
        shutil.copytree(tmp_path / "kept", path.with_name("new.prt.restart"))


class Killed(BaseException):
    """The process is no more."""


@contextmanager
def killed_at(renames):
    """Ends the process, as far as a test can, after so many renames of folders of a swap."""
    rename, done = os.rename, []

    def counting(source, target):
        if len(done) == renames:
            raise Killed
        done.append(target)
        rename(source, target)

    def removing(path):
        if done:
            raise Killed

    with pytest.MonkeyPatch.context() as patch, pytest.raises(Killed):
        patch.setattr(os, "rename", counting)
        patch.setattr("prt_core.store.places.remove_tree", removing)
        yield


@pytest.mark.parametrize("renames", [0, 1, 2])
@pytest.mark.parametrize("opener", ["load", "bake", "restart", "store"])
def test_a_kill_during_the_swap_is_finished_by_whoever_comes_next(
    baked, finished, other, another, counted, renames, opener
):
    def bake(restart):
        settings = replace(COUNTED, seed=3)
        return run(bake_steps(other, baked, settings, LAMPS, WORLD, restart=restart))

    with killed_at(renames):
        bake(True)
    assert len(beside(baked)) == 2
    counted.rays = 0
    if opener == "load":
        load(baked)
    elif opener == "store":
        BakeStore(baked, "r+")
    else:
        bake("changed" if opener == "bake" else True)
        assert beside(baked) == ["a.prt"]
    # The new bake was finished before: no ray is cast again.
    assert counted.rays == 0
    expect_same(baked, another if renames or opener in ("bake", "restart") else finished)


def test_a_rename_that_fails_leaves_the_old_bake(baked, finished, other, monkeypatch):
    rename = os.rename

    def failing(source, target):
        if str(source).endswith(".restart"):
            raise PermissionError(13, "Permission denied")
        rename(source, target)

    monkeypatch.setattr(os, "rename", failing)
    with pytest.raises(PRTError, match="cannot be put in its place \\(Permission denied\\)"):
        run(bake_steps(other, baked, SETTINGS, restart=True))
    monkeypatch.undo()
    expect_same(baked, finished)
    run(bake_steps(other, baked, SETTINGS, restart=True))
    shown = load(baked).scene.points.visible.sum()
    assert shown == other.points.visible.sum() and beside(baked) == ["a.prt"]


def _old_version(path):
    meta = (path / "zarr.json").read_text().replace('"version": 3', '"version": 2')
    (path / "zarr.json").write_text(meta)


@pytest.mark.parametrize(
    "damage",
    [
        _old_version,
        lambda p: (p / "zarr.json").write_text("{"),
        lambda p: (p / "zarr.json").write_bytes(b""),
        lambda p: (p / "zarr.json").unlink(),
        lambda p: shutil.rmtree(p / "visibility"),
        lambda p: (p / "visibility" / "c" / "0" / "0").write_bytes(b"x"),
        lambda p: ((p / "zarr.json").unlink(), os.mkfifo(p / "zarr.json")),
        lambda p: ((p / "zarr.json").unlink(), (p / "zarr.json").symlink_to("/etc/passwd")),
        lambda p: (p / "point_areas" / "c" / "1").symlink_to("/etc"),
        lambda p: forge_facts(p, identity=7),
    ],
)
def test_a_damaged_or_older_bake_can_be_restarted_and_removed(baked, finished, bake_again, damage):
    damage(baked)
    copy = shutil.copytree(baked, baked.with_name("c.prt"), symlinks=True, copy_function=_copy)
    bake_again(baked, restart=True)
    expect_same(baked, finished)
    remove_bake(copy)
    assert beside(baked) == ["a.prt"]
    assert os.path.getsize("/etc/passwd") > 0


def _copy(source, target):
    if os.path.isfile(source):
        return shutil.copy2(source, target)
    os.mkfifo(target)
    return target


@pytest.mark.parametrize(
    "name", ["work.txt", "visibility/work.txt", "work/c/0/work", "c/0", "a-b/c"]
)
def test_a_folder_with_what_no_bake_holds_is_never_removed(tmp_path, finished, bake_again, name):
    empty, bake = tmp_path / "precious", shutil.copytree(finished, tmp_path / "a.prt")
    empty.mkdir()
    for folder in (empty, bake):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("mine")
        for call in (lambda f: bake_again(f, restart=True), remove_bake):
            with pytest.raises(PRTError, match="is not a bake") as caught:
                call(folder)
            assert "\n" not in str(caught.value)
        assert (folder / name).read_text() == "mine"
        assert not folder.with_name(folder.name + ".restart").exists()
    expect_same(bake, finished)


def test_nothing_is_swept_out_of_a_folder_that_is_no_bake(tmp_path, bake_again):
    """Another program may be writing there."""
    left = tmp_path / "theirs" / "inside" / f"zarr.{'0a' * 16}.partial"
    left.parent.mkdir(parents=True)
    left.write_text("theirs")
    (tmp_path / "theirs" / "work.txt").write_text("theirs")
    for restart in (False, True, "changed"):
        with pytest.raises(PRTError, match="is not a bake"):
            bake_again(tmp_path / "theirs", restart=restart)
    assert left.read_text() == "theirs"


def test_the_store_of_another_library_is_never_removed(tmp_path, bake_again):
    import zarr

    group = zarr.create_group(str(tmp_path / "theirs.prt"), zarr_format=3)
    group.create_array("visibility", shape=(3,), dtype="int32")[:] = 7
    for call in (lambda f: bake_again(f, restart=True), bake_again, remove_bake, load):
        with pytest.raises(PRTError, match="is not a bake of this library"):
            call(tmp_path / "theirs.prt")
    assert group["visibility"][0] == 7


def test_the_clutter_of_file_managers_is_no_reason_to_keep_a_bake(baked):
    (baked / ".DS_Store").write_bytes(b"\0")
    (baked / "visibility" / "c" / "Thumbs.db").write_bytes(b"\0")
    remove_bake(baked)
    assert beside(baked) == []


def test_remove_takes_what_restarts_left_as_well(baked, finished):
    for name in ("a.prt.restart", "a.prt.replaced"):
        shutil.copytree(finished, baked.with_name(name))
    remove_bake(baked)
    assert beside(baked) == []
    with pytest.raises(PRTError, match="there is no such bake"):
        remove_bake(baked)


def test_links_are_not_followed(baked, tmp_path, bake_again):
    (tmp_path / "link.prt").symlink_to(baked)
    (tmp_path / "none.prt").symlink_to(tmp_path / "nowhere")
    for name in ("link.prt", "none.prt"):
        for call in (remove_bake, bake_again, lambda p: bake_again(p, restart=True)):
            with pytest.raises(PRTError, match="is a symbolic link"):
                call(tmp_path / name)
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "file").write_text("mine")
    (baked / "point_areas" / "c" / "1").symlink_to(outside)
    remove_bake(baked)
    assert (outside / "file").read_text() == "mine" and not baked.exists()


@pytest.mark.parametrize("path", [".", "/", ".."])
def test_a_path_without_a_name_is_said(path, bake_again):
    for call in (load, bake_again, remove_bake, lambda p: bake_again(p, restart=True)):
        with pytest.raises(PRTError, match="expected the name of a folder, NAME.prt"):
            call(path)


def test_a_store_that_is_begun_is_the_one_that_is_finished(tmp_path):
    path = tmp_path / "a.prt"
    store = begin_bake(path, {"scene": "a"})
    assert store.path == path and not path.exists()
    store.update(identity={"scene": "a"})
    store.write("some", np.arange(7))
    store.seal()
    assert finish_bake(store, path) is store
    new = begin_bake(path, {"scene": "b"}, "changed")
    new.update(identity={"scene": "b"})
    new.write("some", np.arange(3))
    new.seal()
    assert BakeStore(path).read("some", (7,)).sum() == 21
    assert finish_bake(new, path).read("some", (3,)).sum() == 3
