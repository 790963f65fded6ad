"""What has moved is baked again: the button, the API and the command line."""

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import bakes, freshness, moving, plan, preview
from blender_addon.shapes import chosen_names
from prt_core.blender.stand_ins import ORIGINAL, is_copy
from prt_core.cli import main
from prt_core.runtime.progress import run
from tests.blender.conftest import colours_on

OPTIONS = {"resolution": 8, "tolerance": 0.05, "caster": "blender"}


@pytest.fixture
def changed(baked_floor):
    """The baked scene, whose ball has moved since."""
    bpy.data.objects["ball"].location.x += 0.3
    bpy.context.view_layer.update()
    return baked_floor


def said():
    return bpy.context.window_manager.prt.message


def away(one, two):
    return np.linalg.norm(one - two) / np.linalg.norm(two)


def floor_light(scene):
    """What points of the floor receive of an even sky, but those whose place hangs on rays."""
    bake = preview.held(scene).bake
    index = [item.name for item in bake.scene.objects].index("floor")
    mine = bake.scene.points.object_index == index
    mine[bake.scene.details.point] = False
    sky = np.ones((bake.cube_map.n_directions, 3), np.float32)
    return bake.transport.received(sky)[mine]


def test_the_button_bakes_what_moved(changed, tmp_path):
    held = preview.held(changed)
    assert not moving.has_changed(changed)
    differences = run(freshness.check_steps(changed, held))
    assert differences.changed == ("ball",)
    bakes.refresh(changed)
    assert moving.has_changed(changed)
    assert bpy.ops.prt.update() == {"FINISHED"}
    assert said().startswith("ball moved: ") and "% of the rays of a whole bake" in said()
    part = {name: colours_on(name) for name in ("ball", "floor")}
    assert not moving.has_changed(changed)
    assert bpy.ops.prt.bake(restart=True) == {"FINISHED"}
    assert said().startswith("Baked ")
    for name, colours in part.items():
        assert away(colours, colours_on(name)) < 0.05
    # The same by the API, from a copy of what the button had.
    report = prt_core.bake(None, tmp_path / "b.prt", reuse=plan.output_path(changed), **OPTIONS)
    assert report["reused"]["line"].startswith("no object changed: 0 of ")


def test_a_copy_that_is_selected_stands_for_its_object(baked_floor):
    """What has modifiers is shown by a realised copy, and hidden itself."""
    ball = bpy.data.objects["ball"]
    ball.modifiers.new("Whole", "TRIANGULATE")
    assert bpy.ops.prt.bake(restart=True) == {"FINISHED"}
    (copy,) = (o for o in baked_floor.objects if is_copy(o))
    assert ball.hide_render and copy[ORIGINAL] == ball
    ball.location.x += 0.3
    bpy.context.view_layer.update()
    for item in bpy.data.objects:
        item.select_set(item == copy)
    chosen = chosen_names(bpy.context, "selection", "something")
    assert chosen == ["ball"]
    assert bpy.ops.prt.update(selected=True) == {"FINISHED"}
    assert "of objects not selected nothing was asked" in said()


def test_a_selection_keeps_the_colours_of_others(changed):
    floor = floor_light(changed)
    for item in bpy.data.objects:
        item.select_set(False)
    with pytest.raises(RuntimeError, match="selection: nothing is selected"):
        bpy.ops.prt.update(selected=True)
    bpy.data.objects["ball"].select_set(True)
    assert bpy.ops.prt.update(selected=True) == {"FINISHED"}
    np.testing.assert_allclose(floor_light(changed), floor, atol=1e-6)
    assert "of objects not selected nothing was asked" in said()
    assert moving.has_changed(changed)
    assert bpy.ops.prt.update() == {"FINISHED"}
    brought = floor_light(changed)
    assert "what a selection left" in said() and not moving.has_changed(changed)
    assert away(brought, floor) > 0.05
    assert bpy.ops.prt.bake(restart=True) == {"FINISHED"}
    np.testing.assert_allclose(brought, floor_light(changed), atol=1e-5)


def test_the_command_updates_in_place_and_beside(changed, tmp_path, capsys):
    bpy.ops.wm.save_mainfile()
    path, file = plan.output_path(changed), bpy.data.filepath
    flags = ["--resolution", "8", "--tolerance", "0.05", "--caster", "blender", "--quiet"]
    beside = ["bake", file, "-o", str(tmp_path / "new.prt"), "--reuse", str(path), *flags]
    assert main(beside) == 0
    assert "reused  ball moved: " in capsys.readouterr().out
    assert main(["compress", str(path), "--tolerance", "0.2", "--quiet"]) == 0
    assert main(["bake", file, "-o", str(path), "--update", *flags]) == 0
    said = capsys.readouterr()
    assert "reused  ball moved: " in said.out
    assert "the compressed form of the bake that was here is gone" in said.out + said.err
    assert main(["compress", str(path), "--tolerance", "0.2", "--quiet"]) == 0
    assert main(["bake", file, "-o", str(path), "--update", *flags]) == 0
    said = capsys.readouterr()
    assert "the compressed form" not in said.out + said.err
    one, two = (prt_core.load(each) for each in (tmp_path / "new.prt", path))
    assert one.transport.fingerprint() == two.transport.fingerprint()
    assert main(["bake", file, "-o", str(path), "--only", "ball", *flags]) != 0
    assert "--only: changes nothing without --reuse or --update" in capsys.readouterr().err
    assert main(["bake", file, "-o", str(path), "--update", "--restart", *flags]) != 0
    assert "update: takes what the output holds" in capsys.readouterr().err
