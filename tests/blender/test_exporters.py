"""Kept colours leave by Blender's own exporters, or it is said that they will not."""

import bpy
import numpy as np
import pytest

from blender_addon import work
from prt_core.blender.colours import KEPT_COLOURS
from prt_core.blender.exporters import offer
from tests.blender.conftest import colours_on, cube
from tests.gltf import Glb

VALUES = np.linspace(0, 3, 72, dtype=np.float32).reshape(24, 3)
NOTHING = "no colours at all"


def coloured(name, reads=None, attribute="Relit", values=VALUES, slots=1):
    """A cube with an attribute, beside another; whose material reads one by its name."""
    item = cube(name, bpy.context.scene.collection)
    for each, colours in (("Other", np.zeros_like(VALUES)), (attribute, values)):
        made = item.data.color_attributes.new(each, "FLOAT_COLOR", "CORNER")
        made.data.foreach_set("color", np.pad(colours, ((0, 0), (0, 1)), constant_values=1).ravel())
    item.data.color_attributes.active_color_index = 0
    item.data.color_attributes.render_color_index = 0
    for _ in range(slots if reads is not None else 0):
        material = bpy.data.materials.new(name)
        if material.node_tree is None:
            material.use_nodes = True
        item.data.materials.append(material)
        if reads == NOTHING:
            continue
        nodes, links = material.node_tree.nodes, material.node_tree.links
        source = nodes.new("ShaderNodeVertexColor")
        source.layer_name = reads
        links.new(source.outputs[0], nodes["Principled BSDF"].inputs["Base Color"])
    return item


def render_colour(item):
    colours = item.data.color_attributes
    return colours[colours.render_color_index].name


def test_a_kept_attribute_is_the_one_for_renders_and_stays_it(baked_floor):
    other = baked_floor.objects["ball"].data.color_attributes.new("Mine", "FLOAT_COLOR", "POINT")
    assert bpy.ops.prt.keep(attribute=other.name + " relit") == {"FINISHED"}
    ball = baked_floor.objects["ball"]
    assert render_colour(ball) == "Mine relit"
    assert ball.data.color_attributes.active_color_name == "PRT Solid"
    # The preview goes on, and goes.
    baked_floor.prt.strength = 2
    assert bpy.ops.prt.relight() == {"FINISHED"}
    assert render_colour(ball) == "Mine relit"
    bpy.ops.prt.clear()
    assert render_colour(ball) == "Mine relit" and "PRT" not in ball.data.color_attributes
    # Kept anew under another name it is that, and without it what is active.
    bpy.ops.prt.load(filepath=str(next(iter(_bakes(baked_floor)))))
    assert bpy.ops.prt.keep(attribute="Later") == {"FINISHED"}
    assert render_colour(ball) == "Later"


def _bakes(scene):
    from blender_addon import plan

    return [plan.output_path(scene)]


@pytest.mark.usefixtures("addon")
def test_notes_say_which_objects_blenders_gltf_will_write_otherwise(tmp_path):
    kept = coloured("kept", reads="Relit")
    white = coloured("white", reads=NOTHING)
    cut = coloured("cut")
    small = coloured("small", values=VALUES / 3)
    fixed = coloured("fixed", reads="")
    several = coloured("several", reads="Relit", slots=2)
    notes = offer(bpy.context.scene, "Relit")
    with_slots = bpy.app.version[:2] == (5, 2)
    said = {note.split(":")[0]: note for note in notes}
    assert set(said) == {"fixed", "white, several" if with_slots else "white", "cut"}
    assert "will write white" in said["white, several" if with_slots else "white"]
    assert "will cut colours above 1" in said["cut"] and "Export Relit glTF" in said["cut"]
    assert "are active for renders" in said["fixed"]
    assert render_colour(fixed) == "Other" and KEPT_COLOURS not in fixed.data
    for item in (kept, white, cut, small, several):
        assert render_colour(item) == "Relit"
        assert item.data.color_attributes.active_color_name == "Other"
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    path = tmp_path / "a.glb"
    bpy.ops.export_scene.gltf(filepath=str(path), export_yup=True)
    largest = {}
    for node in (file := Glb(path, check=False)).json["nodes"]:
        (part, *_) = file.json["meshes"][node["mesh"]]["primitives"]
        largest[node["name"]] = file.array(part["attributes"]["COLOR_0"])[:, :3]
    # Blender 4.2 writes 16 bits.
    assert largest["kept"].max() == 3 and np.isclose(largest["cut"].max(), 1, atol=1e-4)
    assert np.isclose(largest["small"].max(), 1, atol=1e-4) and largest["small"].min() == 0
    assert largest["white"].min() == 1


@pytest.mark.parametrize("domain", ["CORNER", "POINT"])
def test_usd_carries_kept_colours_as_they_are(baked_floor, tmp_path, domain):
    baked_floor.prt.exposure = 6
    assert bpy.ops.prt.keep(attribute="Relit", domain=domain) == {"FINISHED"}
    bpy.ops.prt.clear()
    wanted = {name: colours_on(name, "Relit").copy() for name in ("floor", "ball")}
    assert max(values.max() for values in wanted.values()) > 1
    path = str(tmp_path / "a.usdc")
    assert bpy.ops.wm.usd_export(filepath=path) == {"FINISHED"}
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=path)
    meshes = [item for item in bpy.data.objects if item.type == "MESH"]
    for name, values in wanted.items():
        (item,) = [
            item
            for item in meshes
            if name in item.name or (item.parent and name in item.parent.name)
        ]
        attribute = item.data.color_attributes["Relit"]
        assert (attribute.data_type, attribute.domain) == ("FLOAT_COLOR", domain)
        np.testing.assert_array_equal(colours_on(item, "Relit"), values)


def test_what_is_kept_is_said_with_its_notes(baked_floor):
    assert bpy.ops.prt.keep(attribute="Relit") == {"FINISHED"}
    assert "'Relit' kept on 2 objects" in work.status().message
