"""Blender's cameras: every pixel looks where Blender's own does."""

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

from prt_core.blender.camera import read_camera, read_cameras
from prt_core.blender.small_render import small_render
from prt_core.scene import view_rays


@pytest.fixture
def camera():
    item = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    parent = bpy.data.objects.new("root", None)
    for each in (item, parent):
        bpy.context.scene.collection.objects.link(each)
    # As FBX brings it.
    item.parent, parent.scale = parent, (0.01, 0.01, 0.01)
    item.location, item.rotation_euler, item.scale = (100, 200, 300), (1.2, 0.3, 0.5), (1, 3, 2)
    bpy.context.scene.camera = item
    return item


def picture_of(width, height, aspect=(1, 1)):
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = width, height
    render.pixel_aspect_x, render.pixel_aspect_y = aspect
    bpy.context.view_layer.update()


@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
@pytest.mark.parametrize(
    ("size", "aspect"), [((700, 400), (1, 1)), ((300, 500), (1, 1)), ((500, 400), (1, 2))]
)
def test_places_are_where_blender_sees_them(camera, kind, fit, size, aspect):
    data = camera.data
    data.type, data.sensor_fit, data.sensor_height = kind, fit, 20
    data.shift_x, data.shift_y, data.ortho_scale = 0.2, -0.15, 5
    data.clip_start, data.clip_end = 0.5, 30
    picture_of(*size, aspect)
    ours = read_camera()
    assert ours.frame == size and ours.lens.startswith(kind[:3].lower().replace("ort", "ortho"))
    rays = view_rays(ours, *size, 1)
    matrix, seen = camera.matrix_world.normalized(), 0
    for local in np.random.default_rng(2).uniform((-2, -2, -6), (2, 2, -3), (40, 3)):
        place = matrix @ Vector(local)
        x, y, depth = world_to_camera_view(bpy.context.scene, camera, place)
        if not (0 < x < 1 and 0 < y < 1):
            continue
        seen += 1
        ray = int((1 - y) * size[1]) * size[0] + int(x * size[0])
        way = np.array(place) - rays.origins[ray]
        along = way @ rays.directions[ray]
        # A pixel is about a hundredth wide there.
        assert np.linalg.norm(way - along * rays.directions[ray]) < 0.03
        deep = rays.directions[ray] @ -ours.axes[:, 2]
        assert along * deep == pytest.approx(depth - 0.5, abs=0.03)
        assert rays.lengths[ray] * deep == pytest.approx(29.5)
    assert seen >= 5


PANORAMAS = {
    "EQUIRECTANGULAR": {"longitude_min": -1, "latitude_max": 1, "shift_x": 0.1, "shift_y": -0.2},
    "FISHEYE_EQUIDISTANT": {"fisheye_fov": 2.5},
    "FISHEYE_EQUISOLID": {"fisheye_fov": 2.5, "fisheye_lens": 9, "sensor_height": 20},
}


@pytest.mark.parametrize("fit", ["AUTO", "VERTICAL"])
@pytest.mark.parametrize("kind", PANORAMAS)
def test_panoramas_look_where_cycles_does(camera, kind, fit):
    data = camera.data
    data.type, data.panorama_type, data.sensor_fit = "PANO", kind, fit
    for name, value in PANORAMAS[kind].items():
        setattr(data, name, value)
    picture_of(16, 24)
    rays = view_rays(read_camera(), 16, 24, 4)
    with small_render() as render:
        # A world that shows the direction in which it is seen.
        world = render.keep(bpy.data.worlds.new("prt test"))
        if world.node_tree is None:
            world.use_nodes = True
        tree = world.node_tree
        tree.nodes.clear()
        place, shader, end = (
            tree.nodes.new(f"ShaderNode{name}")
            for name in ("TexCoord", "Background", "OutputWorld")
        )
        tree.links.new(place.outputs["Generated"], shader.inputs["Color"])
        tree.links.new(shader.outputs[0], end.inputs["Surface"])
        render.scene.world = world
        render.scene.collection.objects.link(camera)
        render.scene.camera = camera
        theirs = render.pixels(16, 24, 64)
    ours = np.where(rays.lengths[:, None] >= 0, rays.directions, 0)
    ours = ours.reshape(24, 4, 16, 4, 3).mean(axis=(1, 3))
    off = np.abs(ours - theirs).max(axis=-1)
    # The edge of a fisheye's disc cuts pixels.
    assert np.mean(off < 0.01) > (0.85 if "FISHEYE" in kind else 0.999) and off.max() < 0.15


def test_a_lens_that_is_not_followed_is_said(camera):
    messages = []
    assert read_camera(messages=messages) is not None and not messages
    camera.data.dof.use_dof = True
    assert read_camera(messages=messages) is not None
    assert messages == ["camera 'camera': its depth of field is ignored"]
    camera.data.type, camera.data.panorama_type = "PANO", "MIRRORBALL"
    assert read_camera(messages=messages) is None
    assert "a lens of type MIRRORBALL is not followed" in messages[1]
    bpy.context.scene.camera = None
    assert read_camera() is None


def test_a_camera_that_was_just_moved_is_where_it_is_now(camera):
    bpy.context.view_layer.update()
    camera.parent, camera.location, camera.rotation_euler = None, (7, -2, 3), (0, 0, 0)
    np.testing.assert_allclose(read_camera().matrix[:3, 3], (7, -2, 3), atol=1e-6)


def test_all_cameras_of_a_scene_are_read_by_name(camera):
    scene = bpy.context.scene
    hidden = bpy.data.objects.new("Behind", bpy.data.cameras.new("behind"))
    scene.collection.objects.link(hidden)
    hidden.location, hidden.hide_render, hidden.hide_viewport = (1, 2, 3), True, True
    hidden.data.type, hidden.data.ortho_scale, hidden.data.shift_x = "ORTHO", 3.0, 0.25
    hidden.data.clip_start, hidden.data.sensor_fit = 0.5, "VERTICAL"
    other = bpy.data.objects.new("Globe", bpy.data.cameras.new("globe"))
    scene.collection.objects.link(other)
    other.data.type, other.data.panorama_type = "PANO", "MIRRORBALL"
    cameras = read_cameras(scene)
    # A lens that is not followed is no camera here.
    assert set(cameras) == {"camera", "Behind"} and cameras["camera"] == read_camera()
    ours = cameras["Behind"]
    np.testing.assert_allclose(ours.position, (1, 2, 3))
    # Blender has no place for what is hidden: it follows from its own and its parents'.
    hidden.parent, camera.parent.location = camera.parent, (0, 0, 7)
    np.testing.assert_allclose(read_cameras(scene)["Behind"].position, (0.01, 0.02, 7.03))
    hidden.constraints.new("COPY_LOCATION").target = camera
    assert set(read_cameras(scene)) == {"camera"}
    hidden.constraints.clear()
    assert ours.lens == "orthographic" and ours.tangent == 1.5 and ours.shift == (0.25, 0)
    assert ours.clip[0] == 0.5 and ours.sensor_fit == "vertical"
    assert ours.pixel_aspect == cameras["camera"].pixel_aspect
