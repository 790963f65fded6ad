import math
from pathlib import Path

import _cycles
import bpy
import numpy as np
import pytest

import build
from prt_core import Lamp, PRTError, run
from prt_core.blender import read_lamps, read_world
from prt_core.blender.world import baked_world_steps, read_environment
from prt_core.light import EnvironmentMap, read_image, write_image
from prt_core.sphere import CubeMap


@pytest.fixture
def world():
    world = bpy.data.worlds.new("w")
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes.clear()
    bpy.context.scene.world = world
    background = world.node_tree.nodes.new("ShaderNodeBackground")
    output = world.node_tree.nodes.new("ShaderNodeOutputWorld")
    world.node_tree.links.new(background.outputs[0], output.inputs["Surface"])
    return world


def test_a_plain_background(world):
    node = world.node_tree.nodes["Background"]
    node.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1)
    node.inputs["Strength"].default_value = 2
    light = read_world(CubeMap(3))
    np.testing.assert_allclose(light, np.tile([0.2, 0.4, 0.6], (54, 1)), rtol=1e-6)


def environment(world, hdri, turn=None, kind="POINT"):
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(hdri("city")))
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    if turn is not None:
        mapping, place = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
        mapping.vector_type = kind
        mapping.inputs["Rotation"].default_value = (0, 0, math.radians(turn))
        tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs[0], texture.inputs["Vector"])


def test_the_world_is_the_image(world, hdri):
    environment(world, hdri)
    cube_map = CubeMap(8)
    wanted = EnvironmentMap.read(hdri("city")).to_cube_map(cube_map)
    np.testing.assert_allclose(read_world(cube_map), wanted, rtol=1e-5)


@pytest.mark.parametrize("kind, sign", [("POINT", -1), ("TEXTURE", 1)])
def test_the_mapping_turns_the_light_as_cycles_does(world, hdri, kind, sign):
    environment(world, hdri, 40, kind)
    cube_map = CubeMap(8)
    wanted = EnvironmentMap.read(hdri("city")).to_cube_map(cube_map, sign * 40)
    np.testing.assert_allclose(read_world(cube_map), wanted, rtol=1e-4)


def test_the_world_of_the_view_layer_goes_before_the_scene_s(world):
    layer = bpy.context.view_layer
    if not hasattr(layer, "world_override"):
        pytest.skip("view layers have worlds of their own since Blender 4.3")
    own = layer.world_override = world.copy()
    own.node_tree.nodes["Background"].inputs["Color"].default_value = (0.1, 0.2, 0.3, 1)
    np.testing.assert_allclose(read_world(CubeMap(3)), np.tile([0.1, 0.2, 0.3], (54, 1)), rtol=1e-6)
    own.cycles_visibility.diffuse = False
    assert read_environment() is None


def test_a_limit_of_bounces_of_a_world_is_said(world):
    messages = []
    world.cycles.max_bounces = 1
    read_environment(messages=messages)
    assert messages == ["world 'w': its limit of 1 bounces is ignored"]


def test_a_world_in_coordinates_of_the_camera_is_said(world):
    tree, messages = world.node_tree, []
    place = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["Window"], tree.nodes["Background"].inputs["Color"])
    read_environment(messages=messages)
    assert messages == [
        "world 'w': Window and Camera coordinates in it are not those of the camera"
    ]


def test_a_world_of_any_nodes_is_what_cycles_renders_of_it(world):
    tree = world.node_tree
    place = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["Generated"], tree.nodes["Background"].inputs["Color"])
    before = [len(kind) for kind in (bpy.data.worlds, bpy.data.scenes, bpy.data.cameras)]
    cube_map = CubeMap(5)
    light = read_world(cube_map)
    # What is seen is the direction itself, where it is not negative: in part of some texels.
    means = cube_map.vectors / cube_map.solid_angles[:, None]
    np.testing.assert_allclose(light, np.maximum(means, 0), atol=0.06)
    assert before == [len(kind) for kind in (bpy.data.worlds, bpy.data.scenes, bpy.data.cameras)]
    assert "Render Result" not in bpy.data.images


def light_path_in_a_group(output):
    group = bpy.data.node_groups.new("g", "ShaderNodeTree")
    group.interface.new_socket("v", in_out="OUTPUT", socket_type="NodeSocketFloat")
    path, end = group.nodes.new("ShaderNodeLightPath"), group.nodes.new("NodeGroupOutput")
    group.links.new(path.outputs[output], end.inputs[0])
    return group


@pytest.mark.parametrize(("output", "seen"), [("Is Diffuse Ray", 1.0), ("Is Camera Ray", 0.0)])
def test_the_world_is_that_of_diffuse_rays(world, output, seen):
    tree = world.node_tree
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group = light_path_in_a_group(output)
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Color"])
    np.testing.assert_allclose(read_world(CubeMap(2)), seen, atol=1e-4)
    assert [n.bl_idname for n in group.nodes] == ["ShaderNodeLightPath", "NodeGroupOutput"]
    assert list(bpy.data.node_groups) == [group]


OSL = "shader tint(output color Tint = 0) { Tint = color(0.2, 0.9, 0.1); }"


def test_osl_scripts_of_worlds_and_lamps_run_where_the_scene_has_them(world, monkeypatch):
    # Where Blender is a module, its own path lacks what finds a script's sockets.
    found = next(Path(bpy.utils.resource_path("LOCAL")).rglob("oslquery"), None)
    if not _cycles.with_osl or found is None:
        pytest.skip("this Blender has no OSL")
    monkeypatch.syspath_prepend(found.parent)
    bpy.context.scene.render.engine = "CYCLES"
    lamp, text = build.lamp("lamp", "POINT", (0, 0, 1), 50), bpy.data.texts.new("tint.osl")
    text.write(OSL)
    if lamp.data.node_tree is None:
        lamp.data.use_nodes = True
    for tree, shader in ((world.node_tree, "Background"), (lamp.data.node_tree, "Emission")):
        script = tree.nodes.new("ShaderNodeScript")
        script.script = text
        tree.links.new(script.outputs["Tint"], tree.nodes[shader].inputs["Color"])
    for runs in (True, False):
        bpy.context.scene.cycles.shading_system = runs
        bpy.context.view_layer.update()
        seen = read_environment().map.pixels.mean(axis=(0, 1)), read_lamps()[0].power / 50
        has_tint = np.allclose(seen, (0.2, 0.9, 0.1), rtol=0.01)
        assert has_tint == runs, seen


def test_a_world_without_light_for_diffuse_rays_is_none(world):
    assert read_environment() is not None
    world.cycles_visibility.diffuse = False
    assert read_environment() is None


def test_a_rendered_world_is_kept_until_it_changes(world):
    tree, ramp = world.node_tree, world.node_tree.nodes.new("ShaderNodeValToRGB")
    tree.links.new(ramp.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    ramp.inputs[0].default_value = 1.0
    first = read_environment().map
    assert read_environment().map is first
    np.testing.assert_allclose(first.pixels, 1, atol=1e-4)
    ramp.color_ramp.elements[1].color = 0.5, 0.25, 2, 1
    np.testing.assert_allclose(read_environment().map.pixels[3, 5], [0.5, 0.25, 2], atol=1e-3)


def test_the_render_of_a_world_is_told_to_nobody(world, capfd):
    """Neither in lines of Blender's, nor to handlers of other add-ons."""
    tree, told = world.node_tree, []
    tree.links.new(
        tree.nodes.new("ShaderNodeTexNoise").outputs["Color"],
        tree.nodes["Background"].inputs["Color"],
    )
    bpy.app.handlers.render_write.append(told.append)
    try:
        capfd.readouterr()
        assert read_environment().map.pixels.std() > 0.01
    finally:
        bpy.app.handlers.render_write.remove(told.append)
    assert capfd.readouterr().out == "" and not told


def test_a_world_of_nodes_waits_for_the_end_of_a_render(world, monkeypatch):
    tree = world.node_tree
    colour = tree.nodes.new("ShaderNodeTexMagic").outputs["Color"]
    tree.links.new(colour, tree.nodes["Background"].inputs["Color"])
    scenes = set(bpy.data.scenes)
    with monkeypatch.context() as rendering:
        rendering.setattr("prt_core.blender.small_render.is_rendering", lambda: True)
        with pytest.raises(PRTError) as caught:
            read_environment()
    assert str(caught.value) == "world 'w': Cycles: a render is under way; wait for its end"
    assert set(bpy.data.scenes) == scenes and read_environment() is not None


def test_the_disc_of_a_sky_is_a_sun_of_its_own(world):
    tree, sky = world.node_tree, world.node_tree.nodes.new("ShaderNodeTexSky")
    if "NISHITA" in sky.bl_rna.properties["sky_type"].enum_items:
        sky.sky_type = "NISHITA"
    sky.sun_elevation, sky.sun_rotation, sky.sun_size = 0.6, 2.0, 0.05
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
    (sun,) = read_environment().suns
    level = math.cos(0.6)
    towards = [math.sin(2) * level, math.cos(2) * level, math.sin(0.6)]
    np.testing.assert_allclose(sun.towards, towards, atol=1e-3)
    assert sun.angle == pytest.approx(0.05, rel=0.07) and sun.of_world
    cube_map = CubeMap(8)
    both, without = read_world(cube_map), read_world(cube_map, suns=False)
    power = np.einsum("dc,d->c", both - without, cube_map.solid_angles)
    np.testing.assert_allclose(power, sun.power, rtol=2e-3)
    sky.sun_disc = False
    assert not read_environment().suns


def test_the_picture_of_a_sequence_is_that_of_the_frame(world, tmp_path):
    for frame, value in ((1, 0.2), (2, 0.8)):
        # Blender 4.2 saves what a script has made as if it were to be looked at.
        write_image(tmp_path / f"{frame:04d}.exr", np.full((2, 4, 3), value, np.float32))
    texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(tmp_path / "0001.exr"))
    texture.image.source, texture.image_user.frame_duration = "SEQUENCE", 2
    texture.image_user.use_auto_refresh = True
    shader = world.node_tree.nodes["Background"]
    world.node_tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    for frame, value in ((1, 0.2), (2, 0.8)):
        bpy.context.scene.frame_set(frame)
        np.testing.assert_allclose(read_environment().map.pixels, value, rtol=0.01)


def test_a_baked_world_has_suns_on_its_texels_and_none_in_its_image(world):
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.1, 0.2, 0.3, 1)
    sun, cube_map = Lamp("sun", [3, 2, 1], angle=0.1), CubeMap(8)
    for light, sky in ((read_environment(), [0.1, 0.2, 0.3]), (None, [0, 0, 0])):
        baked = run(baked_world_steps(cube_map, light, [sun]))
        np.testing.assert_allclose(baked.image.pixels, np.reshape(sky, (1, 1, 3)), rtol=1e-6)
        by_sun = baked.texels - np.float32(sky)
        np.testing.assert_allclose(by_sun.T @ cube_map.vectors[:, 2], [3, 2, 1], rtol=0.02)


def test_what_the_world_lacks_is_named(world):
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    with pytest.raises(PRTError, match="the texture 'Environment Texture' has no image"):
        read_world(CubeMap(2))


def test_lamps_have_their_units():
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, 0, 0))
    bpy.context.object.data.energy, bpy.context.object.data.angle = 3, 0.2
    bpy.ops.object.light_add(type="AREA", location=(0, 0, 2))
    bpy.context.object.scale = (2, 1, 1)
    bpy.context.object.data.size = 0.5
    sun, area = sorted(read_lamps(), key=lambda lamp: lamp.kind, reverse=True)
    np.testing.assert_allclose(sun.towards, [0, -math.sin(0.5), math.cos(0.5)], atol=1e-6)
    assert sun.angle == pytest.approx(0.2) and area.size == pytest.approx((1.0, 0.5))
    cube_map = CubeMap(32)
    light = read_world(cube_map) if bpy.context.scene.world is None else None
    power = np.einsum("dc,dx,x->c", light, cube_map.vectors, sun.towards)
    np.testing.assert_allclose(power, 3, rtol=2e-3)


def test_radiance_hdr_is_read_through_blender(tmp_path):
    # Flat RGBE: mantissas of 8 bits and an exponent; the highest row first.
    mantissa = np.arange(4 * 8 * 3, dtype=np.uint8).reshape(4, 8, 3) + 100
    exponent = np.array([120, 128, 129, 136], np.uint8)
    rgbe = np.concatenate([mantissa, np.tile(exponent[:, None, None], (1, 8, 1))], axis=-1)
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n"
    (tmp_path / "sky.hdr").write_bytes(header + rgbe.tobytes())
    wanted = mantissa * 2.0 ** (exponent.astype(float) - 136)[:, None, None]
    np.testing.assert_allclose(read_image(tmp_path / "sky.hdr"), wanted, rtol=0.006)


def test_cycles_agrees_on_where_the_light_is(world, hdri):
    """A plane turned six ways, lit by an HDRI: Cycles' bake against ours."""
    from prt_core.blender.depsgraph import read_scene
    from prt_core.transport import Transport, visibility_bits
    from tests.benchmarks import cycles_truth

    for i, angles in enumerate([(0, 0, 0), (1.57, 0, 0), (1.57, 0, 1.57), (1.57, 0, 3.1)]):
        bpy.ops.mesh.primitive_plane_add(location=(100 * i, 0, 0), rotation=angles)
        bpy.context.object.name = f"plane {i}"
        bpy.context.object.data.materials.append(build.diffuse("d", (0.8, 0.8, 0.8)))
    scene = read_scene()
    cube_map = CubeMap(16)
    caster = scene.make_caster("blender")
    bits = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    caster.close()
    points = scene.points
    transport = Transport(cube_map, bits, None, points.normals, points.albedo)
    light = EnvironmentMap.read(hdri("courtyard")).to_cube_map(cube_map)
    ours = transport.radiance(light)
    cycles_truth.set_light(bpy.context.scene, "courtyard")
    cycles_truth.set_cycles(bpy.context.scene, 512, 0)
    names = [item.name for item in scene.objects]
    truth, _ = cycles_truth.bake(bpy.context.scene, names, "direct")
    for item in scene.objects:
        mine = ours[item.corner_point].mean(axis=0)
        np.testing.assert_allclose(mine, truth[item.name].mean(axis=0), rtol=0.03)
