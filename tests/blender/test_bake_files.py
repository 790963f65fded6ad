"""Whose a bake is: names by file and scene, nothing replaced unasked, and what is stale is said."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import bakes, live, naming, operators, plan, preview, saving, work
from prt_core import BakeStore
from prt_core.store.attributes import write_attributes
from prt_core.store.places import beside
from tests.blender.conftest import colours_on, cube, quick

pytestmark = pytest.mark.usefixtures("addon")


def save_as(path, **options):
    bpy.ops.wm.save_as_mainfile(filepath=str(path), **options)


def reopen(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.context.scene


def new_file():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return quick(bpy.context.scene)


def shown():
    return Path(preview.path_of(bpy.context.scene))


def error_of(operator, **options):
    with pytest.raises(RuntimeError) as caught:
        operator(**options)
    return str(caught.value)


def identity(path):
    return BakeStore(path).attributes["identity"]


def stop_at_visibility(scene, close=True):
    """A bake as the button makes it, stopped (or not yet) while its rays are cast."""
    from prt_core.api import bake_blend_steps

    path, settings = plan.output_path(scene), plan.bake_settings(scene)
    steps = bake_blend_steps(None, path, settings, restart="changed", pace=0.001, scene=scene)
    while next(steps).stage != "visibility":
        pass
    if close:
        steps.close()
    return steps


def test_two_files_of_a_folder_have_bakes_of_their_own(baked_floor, tmp_path):
    first = shown()
    assert first == tmp_path / "prt" / "scene_Scene.prt"
    bpy.ops.wm.save_mainfile()
    one, before = colours_on("floor").copy(), identity(first)
    save_as(tmp_path / "v02.blend")
    assert shown() == first, "the new file shows its old bake"
    bpy.context.scene.objects["ball"].location.x += 0.5
    bpy.ops.prt.bake()
    assert shown() == tmp_path / "prt" / "v02_Scene.prt" and identity(first) == before
    bpy.ops.wm.save_mainfile()
    two = colours_on("floor").copy()
    assert (one != two).any()
    scene = reopen(tmp_path / "scene.blend")
    bpy.ops.prt.relight()
    np.testing.assert_array_equal(colours_on("floor"), one)
    assert not preview.held(scene).warned and bakes.listed(scene) is False
    bpy.ops.prt.refresh()
    others = {item.name: item.origin for item in work.status().bakes}
    assert others == {"scene_Scene": "", "v02_Scene": "'../v02.blend', scene 'Scene'"}


def test_a_bake_by_the_scenes_name_alone_goes_on_working(baked_floor, tmp_path):
    old = tmp_path / "prt" / "Scene.prt"
    shown().rename(old)
    baked_floor.prt.loaded = "//prt/Scene.prt"
    bpy.ops.wm.save_mainfile()
    scene = reopen(tmp_path / "scene.blend")
    assert bpy.ops.prt.relight() == {"FINISHED"} and not preview.held(scene).warned
    scene.objects["ball"].location.x += 0.5
    before = identity(old)
    bpy.ops.prt.bake()
    assert shown().name == "scene_Scene.prt" and identity(old) == before


def test_a_bake_of_another_file_is_not_replaced_unasked(baked_floor, tmp_path):
    baked_floor.prt.name = "hero"
    bpy.ops.prt.bake()
    hero = tmp_path / "prt" / "hero.prt"
    before = identity(hero)
    save_as(tmp_path / "v02.blend")
    bpy.context.scene.objects["ball"].location.x += 0.5
    said = error_of(bpy.ops.prt.bake)
    assert "hero.prt: is a bake of '../scene.blend', scene 'Scene'; give this one" in said
    assert work.status().failed and identity(hero) == before
    bpy.ops.prt.bake(restart=True)
    assert (
        identity(hero) != before and BakeStore(hero).attributes["origin"]["file"] == "../v02.blend"
    )
    # Moved together they still belong together.
    shutil.copytree(tmp_path / "prt", tmp_path / "moved" / "prt")
    shutil.copy(tmp_path / "v02.blend", tmp_path / "moved")
    quick(reopen(tmp_path / "moved" / "v02.blend")).prt.name = "hero"
    bpy.context.scene.objects["ball"].location.x -= 0.3
    assert bpy.ops.prt.bake() == {"FINISHED"}


def test_a_file_that_was_moved_away_from_its_bakes_has_them_still(baked_floor, tmp_path):
    baked_floor.prt.folder = str(tmp_path / "bakes")
    bpy.ops.prt.bake()
    bpy.ops.wm.save_mainfile()
    path = shown()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    (tmp_path / "elsewhere").mkdir()
    shutil.copy(tmp_path / "scene.blend", tmp_path / "elsewhere")
    scene = reopen(tmp_path / "elsewhere" / "scene.blend")
    scene.objects["ball"].location.x += 0.5
    assert plan.output_path(scene) == path
    assert "is a bake of '../scene.blend'" in error_of(bpy.ops.prt.bake), "the first is there yet"
    (tmp_path / "scene.blend").unlink()
    assert bpy.ops.prt.bake() == {"FINISHED"} and shown() == path


def test_a_bake_of_unknown_origin_is_not_replaced_either(baked_floor, tmp_path):
    path = shown()
    BakeStore(path, "a").update(origin=None)
    assert bpy.ops.prt.bake() == {"FINISHED"}, "it is the one that is shown"
    BakeStore(path, "a").update(origin=None)
    bpy.ops.prt.clear()
    assert "is a bake of an unknown file" in error_of(bpy.ops.prt.bake)


def test_a_bake_that_another_scene_shows_is_not_replaced(baked_floor):
    before = identity(shown())
    baked_floor.name = "Day"
    other = quick(bpy.data.scenes.new("Scene"))
    cube("cube", other.collection)
    bpy.context.window.scene = other
    assert "is shown by the scene 'Day'" in error_of(bpy.ops.prt.bake)
    bpy.context.window.scene = baked_floor
    assert identity(shown()) == before
    bpy.ops.prt.bake()
    assert shown().name == "scene_Day.prt"


def test_names_are_names_of_files_and_stay_apart():
    assert naming.file_name("v01_Scene") == "v01_Scene"
    assert naming.file_name("Küche 2 (Abend)_シーン") == "Küche 2 (Abend)_シーン"
    odd = ["a/b_S", "a?b_S", "a:b_S", "../b_S", "..", " ", "", "x" * 200, "x" * 201, "日" * 80]
    names = [naming.file_name(text) for text in odd]
    assert len(set(names)) == len(odd)
    for name in names:
        assert name and not set(name) & set('/\\:*?"<>|\n') and len(name.encode()) < 140
        assert name == name.strip(" .")


def test_files_without_a_name_have_bakes_of_their_own(tmp_path):
    paths = []
    for size in (0.2, 0.3):
        scene = new_file()
        cube("cube", scene.collection, size)
        bpy.ops.prt.bake()
        paths.append(shown())
    assert paths[0] != paths[1] and all(plan.is_temporary(path) for path in paths)
    assert paths[0].is_dir()
    # A copy gets a copy; the open file goes on without a name.
    save_as(tmp_path / "copy.blend", copy=True)
    assert shown() == paths[1] and paths[1].is_dir()
    # What the name stands for is there already: it is not touched.
    taken = tmp_path / "prt" / "mine_Scene.prt"
    shutil.copytree(paths[0], taken)
    before = identity(taken)
    save_as(tmp_path / "mine.blend")
    assert shown() == tmp_path / "prt" / "mine_Scene.001.prt" and identity(taken) == before
    assert not paths[1].exists() and preview.held(bpy.context.scene) is not None
    assert bpy.ops.prt.relight() == {"FINISHED"}
    for name in ("copy", "mine"):
        scene = reopen(tmp_path / f"{name}.blend")
        assert shown().parent == tmp_path / "prt" and shown().name.startswith(name)
        assert bpy.ops.prt.relight() == {"FINISHED"} and not preview.held(scene).warned


def test_a_bake_that_cannot_go_along_stays_where_it_is(tmp_path):
    scene = new_file()
    cube("cube", scene.collection)
    bpy.ops.prt.bake()
    path = shown()
    (tmp_path / "prt").write_text("a file is in the way")
    save_as(tmp_path / "new.blend")
    assert shown() == path and path.is_dir() and (tmp_path / "new.blend").is_file()
    assert "the bake could not be saved with the file" in work.status().message
    assert bpy.ops.prt.relight() == {"FINISHED"}


def test_a_stopped_bake_gets_its_name_with_the_file(tmp_path):
    scene = quick(bpy.context.scene)
    cube("cube", scene.collection)
    path = plan.output_path(scene)
    steps = stop_at_visibility(scene, close=False)
    # While it is made it stays where it is.
    work.status().running = True
    save_as(tmp_path / "early.blend")
    work.status().running = False
    assert path.is_dir() and not (tmp_path / "prt").exists()
    steps.close()
    scene = new_file()
    cube("cube", scene.collection)
    stop_at_visibility(scene)
    save_as(tmp_path / "late.blend")
    assert not BakeStore(tmp_path / "prt" / "late_Scene.prt").attributes.get("complete")
    assert bpy.ops.prt.bake() == {"FINISHED"} and shown().name == "late_Scene.prt"


def test_a_bake_goes_beside_the_file_that_was_saved_meanwhile(tmp_path):
    scene = quick(bpy.context.scene)
    cube("cube", scene.collection)
    bpy.ops.prt.bake()
    path = shown()
    moved = tmp_path / "moved.prt"
    shutil.copytree(path, moved)
    save_as(tmp_path / "late.blend")
    shutil.copytree(moved, path)
    bpy.context.scene.prt.loaded = str(path)
    home = saving.settle(bpy.context.scene, path)
    assert home == tmp_path / "prt" / "late_Scene.001.prt" and not path.exists()
    assert saving.settle(bpy.context.scene, home) == home == shown()


def test_a_bake_that_is_stopped_goes_beside_the_file_that_was_saved_meanwhile(tmp_path):
    scene = quick(bpy.context.scene)
    cube("cube", scene.collection)
    path = plan.output_path(scene)
    steps = stop_at_visibility(scene, close=False)
    work.status().running = True
    save_as(tmp_path / "late.blend")
    work.status().running = False
    steps.close()
    operators.PRT_OT_bake.stopped(SimpleNamespace(scene=scene, path=path), bpy.context)
    assert not path.exists() and [b.name for b in work.status().bakes] == ["late_Scene"]
    assert bpy.ops.prt.bake() == {"FINISHED"} and shown().name == "late_Scene.prt"
    assert any("went on" in text for text in preview.held(scene).bake.report["messages"])


def test_a_stopped_bake_that_is_to_replace_another_goes_with_the_file_too(tmp_path):
    scene = quick(bpy.context.scene)
    item = cube("cube", scene.collection)
    bpy.ops.prt.bake()
    old, before = shown(), identity(shown())
    item.location.x += 0.5
    stop_at_visibility(scene)
    assert beside(old).is_dir()
    frame = BakeStore(old).attributes["origin"]["frame"]
    scene.frame_set(scene.frame_current + 6)
    save_as(tmp_path / "new.blend")
    path = tmp_path / "prt" / "new_Scene.prt"
    assert shown() == path and identity(path) == before and beside(path).is_dir()
    origin = BakeStore(path).attributes["origin"]
    assert origin == {"file": "../new.blend", "scene": "Scene", "frame": frame}
    assert not old.exists() and not beside(old).exists()
    assert bpy.ops.prt.bake() == {"FINISHED"} and identity(path) != before
    assert any("went on" in text for text in preview.held(scene).bake.report["messages"])
    assert BakeStore(path).attributes["origin"]["file"] == "../new.blend"


def test_a_changed_scene_leaves_the_old_bake_until_the_new_one_is_finished(baked_floor):
    path, before = shown(), identity(shown())
    baked_floor.objects["ball"].location.x += 0.5
    stop_at_visibility(baked_floor)
    bpy.ops.prt.refresh()
    (item,) = work.status().bakes
    assert item.complete and bakes.state(baked_floor, item)[0] == "stale: ball changed"
    assert bakes.goes_on(baked_floor)
    preview.forget()
    assert bpy.ops.prt.load(filepath=str(path)) == {"FINISHED"} and identity(path) == before
    assert bpy.ops.prt.bake() == {"FINISHED"} and identity(path) != before
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    (item,) = work.status().bakes
    assert bakes.state(baked_floor, item)[0] == "fresh" and not bakes.goes_on(baked_floor)
    # How fast the rays were is not known where some were cast before; the plan goes without.
    assert any("went on" in text for text in item.notes.split("\n"))
    assert item.rate == 0 and bakes.rate(item.back_end) is None
    assert bpy.ops.prt.refresh() == {"FINISHED"}


def test_a_bake_is_deleted_with_what_was_to_replace_it(baked_floor):
    path = shown()
    baked_floor.objects["ball"].location.x += 0.5
    stop_at_visibility(baked_floor)
    assert beside(path).is_dir()
    assert bpy.ops.prt.remove(filepath=str(path)) == {"FINISHED"}
    assert not list(path.parent.iterdir()) and not work.status().bakes


def older(path):
    store = BakeStore(path)
    write_attributes(store.files, {**store.attributes, "version": 2})


def edited(path):
    file = path / "zarr.json"
    file.write_text(file.read_text().replace('"complete": true', '"complete": false'))


@pytest.mark.parametrize(("damage", "why"), [(older, "older version"), (edited, "edited")])
def test_a_bake_that_cannot_be_read_is_listed_with_the_way_out(baked_floor, damage, why):
    path = shown()
    (path.parent / "foreign.prt").mkdir()
    (path.parent / "foreign.prt" / "letter.txt").write_text("not a bake")
    damage(path)
    said = error_of(bpy.ops.prt.bake)
    assert why in said and "delete that one under Bakes" in said
    bpy.ops.prt.refresh()
    (item,) = work.status().bakes
    text, icon = bakes.state(baked_floor, item)
    assert why in text and icon == "ERROR" and not item.complete
    assert bpy.ops.prt.remove(filepath=item.path) == {"FINISHED"}
    assert bpy.ops.prt.bake() == {"FINISHED"} and shown() == path
    assert (path.parent / "foreign.prt" / "letter.txt").is_file()


def test_a_bake_that_was_killed_in_its_first_moments_is_begun_again(floor_scene):
    path = plan.output_path(floor_scene)
    path.mkdir(parents=True)
    (path / f"zarr.json.{'0a' * 8}.part").write_bytes(b'{"zarr_')
    assert bpy.ops.prt.bake() == {"FINISHED"} and shown() == path


def test_saving_a_copy_elsewhere_changes_nothing_here(baked_floor, tmp_path):
    (tmp_path / "deeper").mkdir()
    loaded = baked_floor.prt.loaded
    save_as(tmp_path / "deeper" / "copy.blend", copy=True)
    assert baked_floor.prt.loaded == loaded == "//prt/scene_Scene.prt"
    reopen(tmp_path / "deeper" / "copy.blend")
    assert shown() == tmp_path / "prt" / "scene_Scene.prt"
    assert bpy.context.scene.prt.loaded == "//../prt/scene_Scene.prt"


def test_images_of_light_stay_within_reach_of_a_file_that_is_saved_elsewhere(floor_scene, tmp_path):
    (tmp_path / "deeper").mkdir()
    bpy.ops.prt.light_set_add()
    lights = floor_scene.prt, floor_scene.prt.sets[0]
    for light, file in zip(lights, ("//maps/day.exr", "/far/night.exr"), strict=True):
        light.file = file
    save_as(tmp_path / "deeper" / "copy.blend", copy=True)
    assert [light.file for light in lights] == ["//maps/day.exr", "/far/night.exr"]
    floor_scene.prt.sets[0].file = "//dusk.exr"
    save_as(tmp_path / "deeper" / "scene.blend")
    assert [light.file for light in lights] == ["//../maps/day.exr", "//../dusk.exr"]
    reopen(tmp_path / "deeper" / "copy.blend")
    settings = bpy.context.scene.prt
    assert [settings.file, settings.sets[0].file] == ["//../maps/day.exr", "/far/night.exr"]


def move_ball(scene):
    scene.objects["ball"].location.x += 0.5
    bpy.context.view_layer.update()


CHANGES = {
    "moved": (move_ball, "ball changed"),
    "new": (lambda scene: cube("cube", scene.collection), "cube new"),
    "gone": (lambda scene: setattr(scene.objects["floor"], "hide_render", True), "floor gone"),
}
BUTTONS = {
    "relight": {}, "keep": {}, "compress": {"method": "harmonics"},
    "export": {"filepath": "//f_##.npz"}, "load": {},
}  # fmt: skip
# All buttons ask in the same way what changed: each button is here, and each change twice.
STALE = [
    ("moved", "relight"), ("new", "relight"), ("gone", "keep"), ("moved", "load"),
    ("new", "export"), ("gone", "compress"),
]  # fmt: skip


@pytest.mark.parametrize("change, button", STALE)
def test_every_button_says_what_is_stale(baked_floor, button, change, capfd):
    baked_floor.frame_end = 1
    do, says = CHANGES[change]
    do(baked_floor)
    wanted = f"scene_Scene.prt: the scene is not the one that was baked ({says}); bake again"
    if button == "compress":
        baked_floor.prt.compress_tolerance = 0.5
    assert getattr(bpy.ops.prt, button)(**BUTTONS[button]) == {"FINISHED"}
    assert preview.held(baked_floor).warned == wanted
    assert f"Warning: {wanted}" in capfd.readouterr().out
    bpy.ops.prt.bake()
    assert preview.held(baked_floor).warned == ""
    assert getattr(bpy.ops.prt, button)(**BUTTONS[button]) == {"FINISHED"}
    said = capfd.readouterr().out.rpartition("Baked")[2]
    # That another exporter will not carry what is kept has nothing to do with the bake.
    assert "Warning" not in said.replace("Warning: floor, ball: Blender's glTF exporter", "")


def test_another_number_of_corners_is_never_coloured(baked_floor):
    mesh = baked_floor.objects["ball"].data
    bpy.ops.mesh.primitive_cube_add()
    baked_floor.objects["ball"].data = bpy.context.object.data
    before = colours_on("floor").copy()
    baked_floor.prt.exposure = 3.0
    for button in ("relight", "keep"):
        assert "the mesh was changed after the bake" in error_of(getattr(bpy.ops.prt, button))
    baked_floor.frame_set(2)
    assert "the mesh was changed" in work.status().message
    np.testing.assert_array_equal(colours_on("floor"), before)
    assert "Relit" not in mesh.attributes


def test_a_file_whose_bake_was_made_of_another_says_so_when_it_opens(baked_floor, tmp_path, capfd):
    """As all files of a folder did that kept their bakes in prt/Scene.prt."""
    bpy.ops.wm.save_mainfile()
    path, other = shown(), tmp_path / "other.prt"
    move_ball(baked_floor)
    prt_core.bake(None, other, resolution=8, tolerance=0.05, caster="blender")
    shutil.rmtree(path)
    other.rename(path)
    scene = reopen(tmp_path / "scene.blend")
    # By the window's timer:
    prt_core.run(live._relight_steps(scene, False))
    wanted = f"{path.name}: the scene is not the one that was baked (ball changed); bake again"
    assert preview.held(scene).warned == wanted
    # By frames without a window, once for all of them:
    scene = reopen(tmp_path / "scene.blend")
    capfd.readouterr()
    for frame in (1, 2, 3):
        scene.prt.exposure = frame
        scene.frame_set(frame)
    assert capfd.readouterr().out.count(f"PRT: WARNING: {wanted}") == 1
    assert work.status().message == wanted and work.status().failed


def expect_said_at_other_frames(scene, capfd):
    """What was baked at frame 1 is said to be of another frame, once, and not at its own."""
    scene.frame_set(1)
    bpy.ops.prt.bake()
    scene.frame_set(1)
    assert preview.held(scene).warned == ""
    capfd.readouterr()
    for frame in (3, 4):
        scene.frame_set(frame)
        assert "(ball changed)" in preview.held(scene).warned
    assert capfd.readouterr().out.count("WARNING") == 1
    scene.frame_set(1)
    assert preview.held(scene).warned == ""


def test_frames_say_what_moves(baked_floor, capfd):
    ball = baked_floor.objects["ball"]
    for frame, x in ((1, 0.0), (5, 0.5)):
        ball.location.x = x
        ball.keyframe_insert("location", frame=frame)
    expect_said_at_other_frames(baked_floor, capfd)
    baked_floor.frame_start, baked_floor.frame_end = 1, 3
    bpy.ops.prt.export(filepath="//f_##.npz")
    assert "(ball at frame 2)" in capfd.readouterr().out


@pytest.mark.parametrize("how", ["shape keys", "modifier", "armature"])
def test_frames_say_what_deforms(baked_floor, capfd, how):
    ball = baked_floor.objects["ball"]
    if how == "shape keys":
        ball.shape_key_add()
        moves, value = ball.shape_key_add(), "value"
    elif how == "modifier":
        moves, value = ball.modifiers.new("Bend", "SIMPLE_DEFORM"), "angle"
    else:
        moves, value = bpy.data.objects.new("rig", bpy.data.armatures.new("rig")), "rotation_euler"
        baked_floor.collection.objects.link(moves)
        ball.modifiers.new("Rig", "ARMATURE").object = moves
    for frame, amount in ((1, 0.0), (5, 0.5)):
        setattr(moves, value, (amount,) * 3 if how == "armature" else amount)
        moves.keyframe_insert(value, frame=frame)
    expect_said_at_other_frames(baked_floor, capfd)


def test_a_slider_reads_no_scene(baked_floor, monkeypatch):
    reads = []
    read_steps = plan.read_steps
    monkeypatch.setattr(plan, "read_steps", lambda *a, **k: reads.append(a) or read_steps(*a, **k))
    for exposure in (1.0, 2.0, 3.0):
        baked_floor.prt.exposure = exposure
        prt_core.run(live._relight_steps(baked_floor, True))
    for frame in (2, 3):
        baked_floor.frame_set(frame)
    assert not reads and plan.reading(baked_floor)[1]
    assert not live._wants_check(baked_floor)
    live.geometry_changed(baked_floor)
    assert live._wants_check(baked_floor)
    prt_core.run(live._check_steps(baked_floor))
    assert len(reads) == 1 and not live._wants_check(baked_floor)


def test_the_command_line_says_what_is_stale(baked_floor, tmp_path, capfd):
    path = str(shown())
    out = str(tmp_path / "lit.blend")
    arguments = ["relight", path, "--light", "world", "--blend", out]
    import blender_addon

    assert blender_addon._command(arguments) == 0
    assert "note" not in capfd.readouterr().out
    move_ball(baked_floor)
    assert blender_addon._command(arguments) == 0
    said = capfd.readouterr().out
    assert "note    the scene is not the one that was baked (ball changed); bake again" in said
