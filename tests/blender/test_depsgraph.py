import bpy
import numpy as np
import pytest

import build
from prt_core import PRTError
from prt_core.blender.depsgraph import read_meshes, read_meshes_steps, read_scene


def by_name(**options):
    return {mesh.name: mesh for mesh in read_meshes(**options)}


def test_a_mirrored_object_keeps_its_outside():
    bpy.ops.mesh.primitive_uv_sphere_add(location=(3, 0, 0))
    bpy.context.object.scale = (-1, 1, 2)
    (mesh,) = read_meshes()
    a, b, c = np.moveaxis(mesh.vertices[mesh.corner_vertex[mesh.triangle_corners]], 1, 0)
    outward = ((a + b + c) / 3 - [3, 0, 0]) / [1, 1, 4]
    face = np.cross(b - a, c - a)
    assert ((face * outward).sum(axis=1) > 0).all()
    corner = mesh.vertices[mesh.corner_vertex] - [3, 0, 0]
    assert ((mesh.corner_normal * corner / [1, 1, 4]).sum(axis=1) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.corner_normal, axis=1), 1, atol=1e-5)


def test_flat_and_smooth_shading_make_their_points():
    bpy.ops.mesh.primitive_cube_add()
    assert read_scene().points.visible.sum() == 24
    bpy.context.object.data.polygons.foreach_set("use_smooth", [True] * 6)
    bpy.context.object.data.update()
    assert read_scene().points.visible.sum() == 8


def test_custom_split_normals_are_used():
    bpy.ops.mesh.primitive_plane_add()
    mesh = bpy.context.object.data
    mesh.polygons.foreach_set("use_smooth", [True])
    mesh.normals_split_custom_set([(0.6, 0, 0.8)] * 4)
    (read,) = read_meshes()
    np.testing.assert_allclose(read.corner_normal, [[0.6, 0, 0.8]] * 4, atol=2e-3)


def test_modifiers_curves_and_instances_are_evaluated_and_said():
    build.SCENES["06_instances"]()
    messages = []
    meshes = {mesh.name: mesh for mesh in read_meshes(messages=messages)}
    assert {"floor", "ring", "sign", "copy 0/figure", "copy 5/figure"} == set(meshes) - {
        f"copy {i}/figure" for i in (1, 2, 3, 4)
    }
    assert meshes["floor"].own_mesh and not meshes["ring"].own_mesh
    # Odd copies are mirrored, even ones stretched by 1.3.
    heights = [np.ptp(meshes[f"copy {i}/figure"].vertices[:, 2]) for i in (0, 1)]
    np.testing.assert_allclose(heights[0] / heights[1], 1.3, rtol=1e-3)
    read_scene(messages=messages)
    assert any("realised copies" in text for text in messages)


def test_a_scene_is_read_however_short_the_steps():
    build.SCENES["06_instances"]()
    whole = read_meshes()
    steps = read_meshes_steps(bpy.context.scene.session_uid, pace=1e-9)
    for _ in range(100):
        try:
            next(steps)
        except StopIteration as end:
            assert [mesh.name for mesh in end.value] == [mesh.name for mesh in whole]
            return
    raise AssertionError("reading does not end")


def test_what_is_hidden_in_renders_is_not_baked():
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.name = "seen"
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.name = "unseen"
    bpy.context.object.hide_render = True
    hidden = bpy.data.collections.new("hidden")
    hidden.hide_render = True
    bpy.context.scene.collection.children.link(hidden)
    hidden.objects.link(bpy.data.objects.new("also unseen", bpy.context.object.data))
    assert set(by_name()) == {"seen"}


def test_receivers_and_unknown_names():
    build.SCENES["08_two_triangle_floor"]()
    meshes = by_name(receivers=["ball"])
    assert meshes["ball"].receives and not meshes["floor"].receives
    with pytest.raises(PRTError, match="'bell'.*there are ball, floor"):
        by_name(receivers=["bell"])
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with pytest.raises(PRTError, match="nothing that renders has faces"):
        by_name()


def test_an_instance_is_meant_by_what_bakes_call_it():
    build.SCENES["06_instances"]()
    for name in ("receivers", "two_sided"):
        meshes = by_name(**{name: ["copy 1/figure"]})
        flag = "receives" if name == "receivers" else "two_sided"
        assert [m.name for m in meshes.values() if getattr(m, flag)] == ["copy 1/figure"]
    receiving = {m.name for m in by_name(receivers=["copy 1", "sign"]).values() if m.receives}
    assert receiving == {"copy 1/figure", "sign"}
    with pytest.raises(PRTError, match="'copy 1/sign'"):
        by_name(receivers=["copy 1/sign"])


def test_what_is_scaled_to_nothing_ends_no_bake():
    """Neither alone, nor beside meshes whose materials are known already."""
    bpy.ops.mesh.primitive_plane_add()
    bpy.context.object.name = "flat"
    bpy.context.object.scale = 0, 0, 0
    with pytest.raises(PRTError, match="no triangle with an area"):
        read_scene()
    bpy.context.object.hide_render = True
    bpy.ops.mesh.primitive_cube_add()
    assert len(read_scene().triangles) == 12
    bpy.data.objects["flat"].hide_render = False
    assert len(read_scene().triangles) == 12


def test_hard_cases_become_a_scene():
    build.SCENES["07_hard_cases"]()
    messages = []
    scene = read_scene(messages=messages)
    for array in scene.points.arrays().values():
        assert np.isfinite(array).all()
    assert any("zero area: 2 triangles without area" in m for m in scene.messages)


def material_with(node_tree):
    bpy.ops.mesh.primitive_plane_add()
    material = bpy.data.materials.new("m")
    if material.node_tree is None:
        material.use_nodes = True
    node_tree(material.node_tree)
    bpy.context.object.data.materials.append(material)
    messages = []
    (mesh,) = read_meshes(messages=messages)
    return mesh.materials.albedo, messages


def test_principled_colour_from_an_attribute():
    def tree(t):
        colour = t.nodes.new("ShaderNodeVertexColor")
        colour.layer_name = "paint"
        shader = t.nodes["Principled BSDF"]
        t.links.new(colour.outputs["Color"], shader.inputs["Base Color"])
        data = bpy.context.object.data.color_attributes.new("paint", "FLOAT_COLOR", "CORNER")
        data.data.foreach_set("color", np.repeat(np.float32([0.1, 0.2, 0.3, 0.4]), 4))

    albedo, messages = material_with(tree)
    # A dielectric reflects some of the light before it comes to its colour.
    np.testing.assert_allclose(albedo[:, 0], np.float64([0.1, 0.2, 0.3, 0.4]) * 0.9625, rtol=5e-3)
    assert any("specular reflection" in m and "ignored" in m for m in messages)


def test_principled_colour_from_an_image():
    image = bpy.data.images.new("quarters", 2, 2, float_buffer=True)
    pixels = np.ones((2, 2, 4), np.float32)
    pixels[..., 0] = [[0.1, 0.2], [0.3, 0.4]]  # lowest row first
    image.pixels.foreach_set(pixels.ravel())

    def tree(t):
        texture = t.nodes.new("ShaderNodeTexImage")
        texture.image, texture.interpolation = image, "Closest"
        texture.extension = "EXTEND"
        t.links.new(texture.outputs["Color"], t.nodes["Principled BSDF"].inputs["Base Color"])

    albedo, _ = material_with(tree)
    uv = np.empty(8, np.float32)
    bpy.context.object.data.uv_layers.active.data.foreach_get("uv", uv)
    wanted = np.array([[0.1, 0.2], [0.3, 0.4]])[uv[1::2].astype(int), uv[::2].astype(int)]
    np.testing.assert_allclose(albedo[:, 0], wanted * 0.9625, rtol=5e-3)


def test_glass_is_taken_as_thin_and_said():
    def tree(t):
        glass = t.nodes.new("ShaderNodeBsdfGlass")
        t.links.new(glass.outputs[0], t.nodes["Material Output"].inputs["Surface"])

    _, messages = material_with(tree)
    assert any("material 'm': glass is taken as thin" in m for m in messages)
