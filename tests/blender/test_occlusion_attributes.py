"""Occlusion on meshes: attributes and their channels by the panel, the call and the line; and
Cycles' own ambient occlusion."""

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import preview
from prt_core.bake.occlusion import baked_occlusion_steps
from prt_core.cli import main
from prt_core.runtime.progress import run
from prt_core.transport import Occlusion
from tests.blender.conftest import cube


def values_on(name, attribute, width=4, field="color"):
    data = bpy.data.objects[name].data.attributes[attribute].data
    values = np.empty(len(data) * width, np.float32)
    data.foreach_get(field, values)
    return values.reshape(-1, width)


def test_the_button_is_the_call(baked_floor):
    wanted = prt_core.occlusion(preview.path_of(baked_floor))
    assert bpy.ops.prt.occlusion() == {"FINISHED"}
    for name in ("floor", "ball"):
        got = values_on(name, "AO")
        np.testing.assert_array_equal(got[:, :3], np.repeat(wanted[name][:, None], 3, axis=1))
        assert (got[:, 3] == 1).all()
    near = prt_core.occlusion(
        preview.path_of(baked_floor), distance=0.5, falloff="linear", caster="blender"
    )
    assert bpy.ops.prt.occlusion(distance=0.5, falloff="linear", attribute="near") == {"FINISHED"}
    np.testing.assert_array_equal(values_on("ball", "near")[:, 0], near["ball"])
    assert near["floor"].mean() > wanted["floor"].mean()


@pytest.mark.parametrize("kind, domain", [("FLOAT_COLOR", "CORNER"), ("BYTE_COLOR", "POINT")])
def test_a_channel_of_an_attribute_leaves_the_rest_of_it(baked_floor, kind, domain):
    mesh = bpy.data.objects["floor"].data
    mask = mesh.color_attributes.new("mask", kind, domain)
    mask.data.foreach_set("color", np.tile(np.float32([0, 1, 0, 1]), len(mask.data)))
    assert bpy.ops.prt.occlusion(attribute="mask", channel="A") == {"FINISHED"}
    mask = mesh.color_attributes["mask"]
    assert (mask.data_type, mask.domain) == (kind, domain)
    got = values_on("floor", "mask")
    assert (got[:, :3] == [0, 1, 0]).all()
    if domain == "CORNER":
        wanted = prt_core.occlusion(preview.path_of(baked_floor))["floor"]
        np.testing.assert_array_equal(got[:, 3], wanted)
    assert got[:, 3].min() < 1


def test_bent_normals_as_vectors_and_as_colours(baked_floor):
    wanted = prt_core.occlusion(preview.path_of(baked_floor), "bent-normal")["ball"]
    assert bpy.ops.prt.occlusion(kind="bent-normal") == {"FINISHED"}
    np.testing.assert_array_equal(values_on("ball", "Bent Normal", 3, "vector"), wanted)
    ask = {"kind": "bent-normal", "encoding": "COLOUR", "attribute": "bent"}
    assert bpy.ops.prt.occlusion(**ask) == {"FINISHED"}
    np.testing.assert_allclose(values_on("ball", "bent")[:, :3], 0.5 + 0.5 * wanted, atol=1e-6)
    with pytest.raises(RuntimeError, match="holds no vectors"):
        bpy.ops.prt.occlusion(kind="bent-normal", attribute="bent")


def test_the_line_writes_the_same(baked_floor, tmp_path):
    path = preview.path_of(baked_floor)
    wanted = prt_core.occlusion(path, "sky")["ball"]
    out, scene = str(tmp_path / "out.blend"), bpy.data.filepath
    line = ["occlusion", path, "--kind", "sky", "--blend", out, "--scene", scene, "--channel", "G"]
    assert main(line) == 0
    bpy.ops.wm.open_mainfile(filepath=out)
    np.testing.assert_array_equal(values_on("ball", "Sky")[:, 1], wanted)


def test_the_names_that_cannot_be(baked_floor):
    with pytest.raises(RuntimeError, match="is the preview's"):
        bpy.ops.prt.occlusion(attribute="PRT")


def test_as_cycles_has_it(floor_scene):
    block = cube("block", floor_scene.collection, 0.2, (0.61, 0.43, 0.47))
    block.rotation_euler = 0.3, 0.2, 0.5
    bpy.context.view_layer.update()
    bpy.ops.wm.save_mainfile()
    scene = floor_scene
    scene.prt.resolution, scene.prt.all_bounces, scene.prt.bounces = "16", False, 0
    assert bpy.ops.prt.bake() == {"FINISHED"}
    held = prt_core.load(preview.path_of(scene))
    bpy.ops.prt.clear()
    scene.render.engine, scene.cycles.samples = "CYCLES", 256
    scene.world = scene.world or bpy.data.worlds.new("World")
    for name in ("ball", "block"):
        item = scene.objects[name]
        truth = item.data.color_attributes.new("truth", "FLOAT_COLOR", "CORNER")
        item.data.color_attributes.active_color = truth
        if not item.data.materials:
            item.data.materials.append(bpy.data.materials.new("plain"))
    for distance in (None, 0.4):
        values = run(baked_occlusion_steps(held, Occlusion(distance=distance), "blender"))
        ours = held.colours(np.repeat(values[:, None], 3, axis=1))
        scene.world.light_settings.distance = distance or 1e4
        for name in ("ball", "block"):
            for other in scene.objects:
                other.select_set(other.name == name)
            bpy.context.view_layer.objects.active = scene.objects[name]
            bpy.ops.object.bake(type="AO", target="VERTEX_COLORS")
            truth = values_on(name, "truth")[:, 0]
            # Noise of a share p is sqrt(p (1 - p) / 256), 0.03 at most; texels add as much.
            off = np.sqrt(((ours[name][:, 0] - truth) ** 2).mean())
            assert off < 0.045, (distance, name, off)
            assert abs(ours[name][:, 0].mean() - truth.mean()) < 0.01, (distance, name)
