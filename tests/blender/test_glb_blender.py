"""The panel's .glb is that of the call, of every kind of object, and Blender reads it back."""

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import preview, work
from blender_addon.request import request
from prt_core.evaluate import to_srgb
from tests.blender.conftest import cube, instance_of, link_from_library, scatter
from tests.gltf import Glb

pytestmark = pytest.mark.usefixtures("addon")


@pytest.fixture
def scene(floor_scene, tmp_path):
    """Shared, mirrored, flattened, linked and instanced objects, text, a curve, a metaball, an
    empty; two materials, a UV map, a name of a library's that the file has as well."""
    scene, link = floor_scene, floor_scene.collection.objects.link
    for name, x, place in (("twin", 0.5, (-0.6, 0.4, 0.5)), ("mirrored", -0.7, (0.7, 0.4, 0.5))):
        other = bpy.data.objects.new(name, scene.objects["ball"].data)
        other.scale.x, other.location = x, place
        link(other)
    box = cube("Würfel/1", scene.collection, 0.2, (-0.7, -0.6, 0.4))
    for name, colour in (("red", (0.8, 0.1, 0.1, 1)), ("blue", (0.1, 0.1, 0.8, 1))):
        material = bpy.data.materials.new(name)
        if material.node_tree is None:
            material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = colour
        box.data.materials.append(material)
    for face in box.data.polygons:
        face.material_index = face.index % 2
    layer = box.data.uv_layers.new()
    layer.data.foreach_set("uv", np.linspace(0, 1, 2 * len(box.data.loops), dtype=np.float32))
    linked = link_from_library(cube("stone"), tmp_path / "library.blend", scene.collection)
    linked.location = (0.1, -0.8, 0.4)
    cube("stone", scene.collection, 0.1, (0.9, -0.7, 0.3))
    parts = bpy.data.collections.new("parts")
    cube("part", parts, 0.1)
    instance_of("group", parts, scene.collection, (0.9, 0.8, 0.3))
    scatter("many", scene.collection, (0, 0.9, 0.2))
    text = bpy.data.curves.new("text", "FONT")
    text.body, text.extrude = "a", 0.05
    bpy.ops.object.metaball_add(radius=0.3, location=(-0.9, 0.9, 0.4))
    for item in (bpy.data.objects.new("text", text), bpy.data.objects.new("nothing", None)):
        item.location = (-0.2, -0.3, 1.2)
        link(item)
    flat = cube("flat", scene.collection, 0.1, (0.4, -0.4, 0.9))
    flat.scale.z = 0
    bpy.context.view_layer.update()
    bpy.ops.wm.save_mainfile()
    assert bpy.ops.prt.bake() == {"FINISHED"}
    return scene


def imported(path):
    """{name of the node: object} of a .glb in an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    bpy.ops.import_scene.gltf(filepath=str(path))
    return {item.name: item for item in bpy.data.objects if item.type == "MESH"}


def corner_values(item, attribute, width):
    """(n_corners, width) of an attribute of an imported mesh."""
    name = "color" if width == 4 else "vector"
    values = np.empty(len(attribute.data) * width, np.float32)
    attribute.data.foreach_get(name, values)
    values = values.reshape(-1, width)
    if attribute.domain == "CORNER":
        return values
    corners = np.empty(len(item.data.loops), np.int32)
    item.data.loops.foreach_get("vertex_index", corners)
    return values[corners]


def test_the_panel_writes_what_the_call_writes_and_blender_reads_it(scene, tmp_path):
    held = preview.held(scene)
    scene.prt.exposure = 0.5
    assert bpy.ops.prt.export_glb(filepath=str(tmp_path / "panel")) == {"FINISHED"}
    lighting = request(scene).lighting
    report = prt_core.export_glb(held.bake, tmp_path / "call.glb", lighting, caster="blender")
    assert (tmp_path / "panel.glb").read_bytes() == (tmp_path / "call.glb").read_bytes()
    said = work.status().message
    assert said.startswith("panel.glb: ") and f"{report['objects']} objects" in said
    glb = Glb(tmp_path / "panel.glb")
    colours = held.bake.colours(prt_core.relight_points(held.bake, lighting, caster="blender"))
    solid = {item.name for item in held.bake.scene.objects if len(item.parts.triangle_corners)}
    assert set(glb.nodes) == solid & set(colours)
    assert {"floor", "Würfel/1", "stone", "group/part", "many", "text", "flat"} < set(glb.nodes)
    known = [(node["extras"].get("prt_object"), node["extras"].get("prt_library"))
             for node in glb.nodes.values()]  # fmt: skip
    assert ("stone", None) in known and ("stone", "library.blend") in known
    assert {m["name"] for _, _, m in glb.primitives("Würfel/1")} == {"red", "blue"}
    assert "TEXCOORD_0" in next(glb.primitives("Würfel/1"))[0]
    mesh = {name: glb.json["meshes"][node["mesh"]] for name, node in glb.nodes.items()}
    place = {n: [p["attributes"]["POSITION"] for p in m["primitives"]] for n, m in mesh.items()}
    assert place["ball"] == place["twin"] == place["mirrored"]
    wanted = {name: glb.corners(name) for name in glb.nodes}
    scale = report["scale"]
    objects = imported(tmp_path / "panel.glb")
    assert set(objects) == set(wanted)
    brightest = max(radiance.max() for _, _, radiance, _ in wanted.values())
    for name, item in objects.items():
        place, _, radiance, uv = (x if x is None else x.reshape(-1, x.shape[-1])
                                  for x in wanted[name])  # fmt: skip
        corners = np.empty(len(item.data.loops), np.int32)
        item.data.loops.foreach_get("vertex_index", corners)
        world = np.array([item.matrix_world @ item.data.vertices[i].co for i in corners])
        assert len(world) == len(place), name
        # Corners of a triangle may begin elsewhere, or go round the other way, in a mirror.
        order = np.lexsort(np.round(np.column_stack([place, np.arange(len(place)) // 3]), 3).T)
        theirs = np.lexsort(np.round(np.column_stack([world, np.arange(len(world)) // 3]), 3).T)
        np.testing.assert_allclose(world[theirs], place[order], atol=1e-4, err_msg=name)
        (attribute,) = item.data.color_attributes
        # Blender keeps COLOR_0 in 8 bits of sRGB, and what has a name of its own as it is.
        assert np.isclose(item.data["prt_scale"], scale)
        shown = to_srgb(corner_values(item, attribute, 4)[:, :3])
        error = shown[theirs].astype(int) - to_srgb(radiance[order] / scale)
        assert np.abs(error).max() <= 1, (name, attribute.data_type)
        shown = corner_values(item, item.data.attributes["_PRT_RADIANCE"], 3)
        assert np.abs(shown[theirs] - radiance[order]).max() <= 1e-6 * brightest, name
        if uv is not None:
            layer = np.empty(len(corners) * 2, np.float32)
            item.data.uv_layers[0].data.foreach_get("uv", layer)
            np.testing.assert_allclose(
                layer.reshape(-1, 2)[theirs], uv[order] * [1, -1] + [0, 1], atol=1e-5
            )


def test_the_button_says_why_not(floor_scene, tmp_path):
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.prt.export_glb(filepath=str(tmp_path / "a.glb"))
    assert bpy.ops.prt.bake() == {"FINISHED"}
    with pytest.raises(RuntimeError, match="weights: there is no compressed form"):
        bpy.ops.prt.export_glb(filepath=str(tmp_path / "a.glb"), weights=True)
    with pytest.raises(RuntimeError, match="expected a name that ends|is a directory"):
        (tmp_path / "taken.glb").mkdir()
        bpy.ops.prt.export_glb(filepath=str(tmp_path / "taken.glb"))
    assert [path.name for path in tmp_path.glob("*.glb")] == ["taken.glb"]
    assert work.status().failed


def test_light_sets_go_out_each_beside_their_blend(floor_scene, tmp_path):
    scene = floor_scene
    assert bpy.ops.prt.bake() == {"FINISHED"}
    for name, weight, strength in (("Day", 0.25, 1.0), ("Night", 0.5, 0.3)):
        assert bpy.ops.prt.light_set_add() == {"FINISHED"}
        kept = scene.prt.sets[-1]
        kept.name, kept.weight, kept.strength = name, weight, strength
    assert bpy.ops.prt.export_glb(filepath=str(tmp_path / "sets.glb")) == {"FINISHED"}
    glb = Glb(tmp_path / "sets.glb")
    said = glb.json["extras"]["PRT"]["lights"]
    assert [(light["name"], light["weight"]) for light in said] == [("Day", 0.25), ("Night", 0.5)]
    for name in glb.nodes:
        for of, _, _ in glb.primitives(name):
            day, night = (of[light["attribute"]] for light in said)
            assert day.max() > 0
            np.testing.assert_allclose(night, 0.3 * day, rtol=1e-5)
            np.testing.assert_allclose(of["_PRT_RADIANCE"], 0.25 * day + 0.5 * night, rtol=1e-5)


def test_light_alone_goes_out_of_the_panel_too(floor_scene, tmp_path):
    assert bpy.ops.prt.bake() == {"FINISHED"}
    path = tmp_path / "a.glb"
    assert bpy.ops.prt.export_glb(filepath=str(path), material="multiplied", harmonics=True)
    said = Glb(path).json["extras"]["PRT"]
    assert said["colours"] == "light" and len(said["harmonics"]["light"]) == 9
