"""Refined meshes in Blender: copies with the colours, the objects they came from, what is kept."""

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import freshness, plan, preview
from prt_core import PRTError, run
from prt_core.blender.carried_over import ROUNDS
from tests.blender.conftest import colours_on


@pytest.fixture
def scene(floor_scene):
    """A floor of two triangles with a UV map below a ball, and a hard sun."""
    floor = floor_scene.objects["floor"].data
    layer = floor.uv_layers.new(name="Map")
    corners = np.empty(len(floor.loops), np.int32)
    floor.loops.foreach_get("vertex_index", corners)
    layer.data.foreach_set("uv", places(floor)[corners, :2].ravel())
    weights = floor.attributes.new("weight", "FLOAT", "POINT")
    weights.data.foreach_set("value", places(floor)[:, 0].copy())
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.rotation_euler, sun.data.angle, sun.data.energy = (0.5, 0.2, 0), 0.0, 3
    floor_scene.collection.objects.link(sun)
    bpy.ops.wm.save_mainfile()
    return floor_scene


def places(mesh):
    values = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


def copies(scene, mark="prt_copy"):
    return {item[mark]: item for item in scene.objects if item.get(mark)}


def test_colours_go_to_a_finer_copy_and_restore_brings_the_object_back(scene):
    scene.prt.refine, scene.prt.refine_vertices = True, 1.2
    assert bpy.ops.prt.bake() == {"FINISHED"}
    floor = scene.objects["floor"]
    built = copies(scene)
    mesh = built["floor"].data
    assert floor.hide_render and len(mesh.vertices) > len(floor.data.vertices) + 10
    assert "Map" in mesh.uv_layers
    rounds = np.empty(len(mesh.vertices), np.int32)
    mesh.attributes[ROUNDS].data.foreach_get("value", rounds)
    assert (rounds[: len(floor.data.vertices)] == 0).all() and rounds[-1] > 0
    colours = colours_on(built["floor"])
    # The shadow that two triangles cannot show.
    assert colours.min() < 0.5 * colours.max()
    # The bake is of the scene: what was refined is known by what it came from.
    assert run(freshness.check_steps(scene, preview.held(scene))).fresh
    assert bpy.ops.prt.clear() == {"FINISHED"}
    assert not floor.hide_render and not copies(scene) and len(floor.data.vertices) == 4


def test_coarse_meshes_are_no_warning_where_they_are_refined(scene):
    run(plan.steps(scene))
    assert any("too few for shadows" in text for text, *_ in plan.warnings(scene))
    scene.prt.refine = True
    assert not any("too few for shadows" in text for text, *_ in plan.warnings(scene))


def test_what_is_kept_has_the_uv_maps_and_attributes_of_its_object(scene):
    scene.prt.refine, scene.prt.refine_vertices = True, 1.2
    bpy.ops.prt.bake()
    assert bpy.ops.prt.keep(attribute="Mine") == {"FINISHED"}
    bpy.ops.prt.clear()
    mesh = copies(scene, "prt_kept")["floor"].data
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    uv = np.empty(len(mesh.loops) * 2, np.float32)
    mesh.uv_layers["Map"].data.foreach_get("uv", uv)
    np.testing.assert_allclose(uv.reshape(-1, 2), places(mesh)[corners, :2], atol=1e-5)
    values = np.empty(len(mesh.vertices), np.float32)
    mesh.attributes["weight"].data.foreach_get("value", values)
    np.testing.assert_allclose(values, places(mesh)[:, 0], atol=1e-5)
    assert "Mine" in mesh.color_attributes and scene.objects["floor"].hide_render


def test_a_bake_says_what_was_refined_and_goes_on_with_it(scene, tmp_path):
    settings = {"resolution": 4, "tolerance": 0.2, "refine": True, "refine_vertices": "1.2x"}
    report = prt_core.bake(None, tmp_path / "a.prt", **settings)
    (line,) = [text for text in report["messages"] if text.startswith("refined: ")]
    assert "floor" in line and "vertices added to" in line
    # The same again is there already, bit by bit.
    assert prt_core.bake(None, tmp_path / "a.prt", **settings) == report
    bake = prt_core.load(tmp_path / "a.prt")
    floor = next(item for item in bake.scene.objects if item.name == "floor")
    assert floor.refined.n_before == 6 and floor.n_vertices == len(floor.refined.vertex_round)
    with pytest.raises(PRTError, match="another scene"):
        prt_core.bake(None, tmp_path / "a.prt", resolution=4, tolerance=0.2)
    with pytest.raises(PRTError, match="changes nothing without refine"):
        prt_core.bake(None, tmp_path / "b.prt", refine_vertices=3)
