"""Image textures on coarse faces: what lies between the corners is seen, and bounced."""

import bpy
import numpy as np
import pytest

from prt_core.blender.depsgraph import read_meshes, read_scene
from prt_core.scene import mesh_digests


def picture(name="painting", size=(16, 8), corner=(1.0, 1.0, 1.0), inside=(0.8, 0.02, 0.02)):
    """A framed image: `inside` in the middle, `corner` in its corner texels."""
    image = bpy.data.images.new(name, *size, float_buffer=False)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.ones((size[1], size[0], 4), np.float32)
    pixels[..., :3] = inside
    for row in (0, -1):
        for column in (0, -1):
            pixels[row, column, :3] = corner
    image.pixels.foreach_set(pixels.ravel())
    return image


def textured(image, name="painting", metallic=0.0):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = image, "Closest"
    shader = tree.nodes["Principled BSDF"]
    shader.inputs["Metallic"].default_value = metallic
    shader.inputs["Specular IOR Level"].default_value = 0
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    return material, node


@pytest.mark.parametrize("metallic", [0.0, 0.5])
def test_a_one_quad_painting_is_red_inside_and_bounces_red(metallic):
    bpy.ops.mesh.primitive_plane_add(size=2)
    bpy.context.object.data.materials.append(textured(picture(), metallic=metallic)[0])
    scene = read_scene()
    # The specular colour of metal counts as diffuse.
    points, share = scene.points, 1.0
    hidden = ~points.visible
    assert hidden.sum() > 100
    np.testing.assert_allclose(points.albedo[~hidden], share, atol=0.02)
    np.testing.assert_allclose(np.median(points.albedo[hidden], axis=0),
                               np.array([0.8, 0.02, 0.02]) * share, atol=0.035)  # fmt: skip
    mean = points.mean_albedo.mean(axis=0)
    assert mean[0] > 0.75 * share and mean[1] < 0.1


def test_faces_of_several_materials_keep_each_its_own():
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=2, y_subdivisions=1, size=2)
    item = bpy.context.object
    plain = bpy.data.materials.new("plain")
    plain.use_nodes = True
    shader = plain.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.1, 0.2, 0.7, 1)
    shader.inputs["Specular IOR Level"].default_value = 0
    item.data.materials.append(textured(picture())[0])
    item.data.materials.append(plain)
    item.data.polygons[1].material_index = 1
    scene = read_scene()
    x = scene.to_world(scene.points.positions)[:, 0]
    side = x * np.sign(item.data.polygons[0].center.x)
    hidden = ~scene.points.visible
    np.testing.assert_allclose(
        np.median(scene.points.albedo[hidden & (side > 0.2)], axis=0), [0.8, 0.02, 0.02], atol=5e-3
    )
    for albedo in (scene.points.albedo, scene.points.mean_albedo):
        np.testing.assert_allclose(
            albedo[side < -0.1], np.tile([0.1, 0.2, 0.7], ((side < -0.1).sum(), 1)), atol=5e-4
        )


def test_an_edit_between_the_corners_is_a_change():
    bpy.ops.mesh.primitive_plane_add()
    image = picture()
    material, node = textured(image)
    bpy.context.object.data.materials.append(material)
    before = mesh_digests(read_meshes())
    assert mesh_digests(read_meshes()) == before
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    pixels[4 * (3 * 16 + 7)] = 0.3  # one texel in the middle
    image.pixels.foreach_set(pixels)
    after = mesh_digests(read_meshes())
    assert after != before
    assert mesh_digests(read_meshes()) == after
    node.interpolation = "Linear"
    assert mesh_digests(read_meshes()) != after
