"""Realised copies in the materials of what they were made of."""

import bmesh
import bpy
import numpy as np
import pytest

from blender_addon import preview
from tests.blender.conftest import colours_on, cube

pytestmark = pytest.mark.usefixtures("addon")


@pytest.fixture
def copied_scene(floor_scene):
    """A ball with a modifier, two slots and a UV map of its own; a mirrored, turned instance."""
    ball = floor_scene.objects["ball"]
    coarse = bmesh.new()
    bmesh.ops.create_uvsphere(coarse, u_segments=12, v_segments=8, radius=ball.dimensions.x / 2)
    coarse.to_mesh(ball.data)
    coarse.free()
    for name in ("First", "Second"):
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        ball.data.materials.append(material)
    while len(ball.data.materials) > 2:
        ball.data.materials.pop(index=0)
    faces = len(ball.data.polygons)
    ball.data.polygons.foreach_set("material_index", np.arange(faces, dtype=np.int32) % 2)
    maps = ball.data.uv_layers
    for layer in list(maps):
        maps.remove(layer)
    maps.new(name="Mine").active_render = True  # where one of another name was, 5.2 has none
    rng = np.random.default_rng(5)
    maps["Mine"].data.foreach_set("uv", rng.random(2 * len(ball.data.loops), np.float32))
    ball.modifiers.new("Fine", "SUBSURF").levels = 1
    ball.modifiers["Fine"].render_levels = 1
    parts = bpy.data.collections.new("parts")
    box = cube("box", parts)
    box.data.materials.append(bpy.data.materials.new("Box"))
    group = bpy.data.objects.new("group", None)
    floor_scene.collection.objects.link(group)
    group.instance_type, group.instance_collection = "COLLECTION", parts
    group.location, group.rotation_euler, group.scale = (0.5, 0.3, 1.5), (0.2, 0, 1), (-1, 2, 1)
    return floor_scene


def copy_of(name):
    return next(item for item in bpy.context.scene.objects if item.get("prt_copy") == name)


def names_of(copy):
    return {material.name for material in copy.data.materials}


def world_places(item):
    places = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.vertices.foreach_get("co", places)
    matrix = np.array(item.matrix_basis)
    return places.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def world_normals(item):
    normals = np.array([corner.vector for corner in item.data.corner_normals])
    turned = normals @ np.linalg.inv(np.array(item.matrix_basis)[:3, :3])
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


@pytest.mark.parametrize("name", ["ball", "group/box"])
def test_a_copy_is_where_it_was_in_the_materials_of_its_object(copied_scene, name):
    bpy.ops.prt.bake()
    plain = world_places(copy_of(name))
    assert [m.name for m in copy_of(name).data.materials] == ["PRT colours"]
    copied_scene.prt.look = "MATERIALS"
    bpy.ops.prt.relight()
    copy, baked = copy_of(name), preview.held(copied_scene).bake
    item = next(item for item in baked.scene.objects if item.name == name)
    np.testing.assert_allclose(world_places(copy), plain, atol=1e-5)
    np.testing.assert_allclose(np.array(copy.matrix_basis), item.parts.matrix, atol=1e-5)
    wanted = baked.scene.points.normals[item.corner_point]
    np.testing.assert_allclose(world_normals(copy), wanted, atol=2e-3)
    light = baked.colours(preview.held(copied_scene).received)[name]
    assert (colours_on(copy, "PRT Light") == light).all()
    numbers = [face.material_index for face in copy.data.polygons]
    for look, shown in (("COLOURS", {"PRT colours"}), ("MATERIALS", names_of(copy))):
        copied_scene.prt.look = look
        bpy.ops.prt.relight()
        assert copy_of(name) == copy and names_of(copy) == shown
        assert [face.material_index for face in copy.data.polygons] == numbers
    bpy.ops.prt.clear()
    assert not [m.name for m in bpy.data.materials if "relit" in m.name or "PRT" in m.name]


@pytest.mark.parametrize("look", ["COLOURS", "MATERIALS"])
def test_copies_are_those_of_the_bake_that_is_shown(copied_scene, look):
    copied_scene.prt.look = look
    bpy.ops.prt.bake()
    before = world_places(copy_of("group/box"))
    faces = copied_scene.objects["ball"].data.polygons
    faces.foreach_set("material_index", np.zeros(len(faces), np.int32))
    copied_scene.objects["group"].location.x += 0.25
    bpy.context.view_layer.update()
    bpy.ops.prt.bake()
    assert not preview.held(copied_scene).warned
    after = world_places(copy_of("group/box"))
    np.testing.assert_allclose(after, before + (0.25, 0, 0), atol=1e-5)
    if look == "MATERIALS":
        assert {face.material_index for face in copy_of("ball").data.polygons} == {0}


def test_slots_and_uv_maps_are_those_of_the_object(copied_scene):
    copied_scene.prt.look = "MATERIALS"
    bpy.ops.prt.bake()
    ball, box = copy_of("ball"), copy_of("group/box")
    assert [m.name for m in ball.data.materials] == ["First relit", "Second relit"]
    assert [m.name for m in box.data.materials] == ["Box relit"]
    evaluated = copied_scene.objects["ball"].evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    numbers, uv = ([], []), ([], [])
    for each, number, places in zip((ball.data, mesh), numbers, uv, strict=True):
        number += [face.material_index for face in each.polygons]
        places += [tuple(corner.uv) for corner in each.uv_layers["Mine"].data]
    evaluated.to_mesh_clear()
    assert numbers[0] == numbers[1] and set(numbers[0]) == {0, 1}
    np.testing.assert_allclose(uv[0], uv[1], atol=1e-6)
