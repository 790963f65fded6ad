"""A bake that is asked for gloss: by call, command and panel, and what it is compared with."""

import bpy
import numpy as np
import pytest

import blender_addon
import prt_core
from blender_addon import plan, preview
from prt_core import PRTError
from prt_core.cli import main
from prt_core.store import BakeStore
from tests.blender.conftest import FLOOR

OPTIONS = {"resolution": 8, "tolerance": 0.05, "caster": "blender"}


def gild(name="ball"):
    """Make an object of the open scene golden."""
    material = bpy.data.materials.new("gold")
    if material.node_tree is None:
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Metallic"].default_value = 1
    shader.inputs["Base Color"].default_value = 1, 0.75, 0.25, 1
    shader.inputs["Roughness"].default_value = 0.25
    bpy.data.objects[name].data.materials.clear()
    bpy.data.objects[name].data.materials.append(material)


def test_call_and_command_read_gloss_where_it_is_asked_for(tmp_path, capsys):
    bpy.ops.wm.open_mainfile(filepath=str(FLOOR))
    gild()
    blend = tmp_path / "gold.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    prt_core.bake(None, tmp_path / "plain.prt", **OPTIONS)
    prt_core.bake(None, tmp_path / "gold.prt", gloss=True, **OPTIONS)
    plain, gold = (BakeStore(tmp_path / f"{name}.prt") for name in ("plain", "gold"))
    assert (
        "gloss" not in plain.attributes["settings"] and "gloss" not in plain.attributes["identity"]
    )
    assert gold.attributes["settings"]["gloss"] is True
    assert "metal" in gold.attributes["materials"] and plain.attributes["materials"] == ["albedo"]
    bake = prt_core.load(tmp_path / "gold.prt")
    names = [item.name for item in bake.scene.objects]
    mine = bake.scene.points.object_index == names.index("ball")
    materials = bake.transport.materials
    np.testing.assert_allclose(materials.metal[mine], [[1, 0.75, 0.25]] * mine.sum(), atol=3e-4)
    np.testing.assert_allclose(materials.roughness[mine], 0.25, atol=3e-4)
    np.testing.assert_array_equal(materials.stand_in[mine], materials.albedo[mine])
    # What is shown without a view is the same, and what bounces is not.
    matte = prt_core.load(tmp_path / "plain.prt").scene.points
    corners = np.arange(len(materials) - len(bake.scene.details))
    corners = corners[: len(matte) - len(prt_core.load(tmp_path / "plain.prt").scene.details)]
    points = bake.scene.points
    np.testing.assert_array_equal(points.positions[corners], matte.positions[corners])
    np.testing.assert_array_equal(points.albedo[corners], matte.albedo[corners])
    away = np.abs(points.mean_albedo[corners] - matte.mean_albedo[corners]).max(axis=1)
    assert (away[mine[corners]] > 1e-3).all() and not away[~mine[corners]].any()
    with pytest.raises(PRTError, match="gloss"):
        prt_core.bake(None, tmp_path / "plain.prt", gloss=True, **OPTIONS)
    with pytest.raises(PRTError, match="gloss: expected True or False, got 'yes'"):
        prt_core.bake(None, tmp_path / "c.prt", gloss="yes", **OPTIONS)
    # The command finds its own bake, finished.
    options = ["--gloss", "--resolution", "8", "--tolerance", "0.05", "--caster", "blender"]
    assert main(["bake", str(blend), "-o", str(tmp_path / "gold.prt"), "--quiet", *options]) == 0
    capsys.readouterr()
    wanted = ["--light", "world", "--scene", str(blend), "--blend", str(tmp_path / "out.blend")]
    assert main(["relight", str(tmp_path / "gold.prt"), *wanted]) == 0
    assert "was baked" not in capsys.readouterr().out


def test_the_panel_compares_with_what_was_read_alike(floor_scene):
    scene = floor_scene
    gild()
    scene.prt.gloss = True
    assert plan.bake_settings(scene).gloss is True
    assert bpy.ops.prt.bake() == {"FINISHED"}
    held = preview.held(scene)
    assert held.gloss and "metal" in held.bake.scene.points.nondefault()

    def state():
        return blender_addon.bakes.state(scene, bpy.context.window_manager.prt.bakes[0])[0]

    assert state() == "fresh" and not held.warned
    # A plan without gloss tells nothing of a bake that has it.
    scene.prt.gloss = False
    assert bpy.ops.prt.refresh() == {"FINISHED"}
    assert state() == "not checked" and not held.warned
    assert bpy.ops.prt.relight() == {"FINISHED"}
    assert state() == "fresh" and not held.warned
    bpy.data.materials["gold"].node_tree.nodes["Principled BSDF"].inputs[
        "Roughness"
    ].default_value = 0.5
    assert bpy.ops.prt.relight() == {"FINISHED"}
    assert "ball changed" in held.warned
