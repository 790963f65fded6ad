"""Any world: colours, skies, images, mixes."""

import math

import bpy
import numpy as np

from tests.conformance.parts import add, box, ground, image, lamp, patches, wall, world
from tests.conformance.scene import scene


def _lit(surface=None, **settings):
    """A box on the ground under a world."""
    ground()
    box(location=(0, 0, 0.5))
    wall()
    world(surface=surface, **settings)


def _background(color=None, strength=1.0):
    """A world of one Background of the colour that `color(tree)` gives."""

    def surface(tree):
        inputs = {"Strength": strength(tree) if callable(strength) else strength}
        if color is not None:
            inputs["Color"] = color(tree)
        return add(tree, "ShaderNodeBackground", inputs).outputs[0]

    return surface


@scene(quick=True)
def world_of_a_colour(on):
    _lit(colour=(0.3, 0.5, 1.0) if on else (0.5, 0.5, 0.5))


@scene(quick=True)
def world_of_a_strength(on):
    _lit(strength=2.5 if on else 1.0)


@scene(light="lamps", quick=True)
def no_world(on):
    ground()
    box(location=(0, 0, 0.5))
    lamp("lamp", "POINT", (1, 1, 1.5), 60 if on else 30)
    bpy.context.scene.world = None


@scene(light="all", quick=True)
def environment_off_in_the_view_layer(on):
    ground()
    box(location=(0, 0, 0.5))
    lamp("lamp", "POINT", (1, 1, 1.5), 60)
    world(strength=2.0)
    bpy.context.view_layer.use_sky = not on


# ---- sky textures


def _sky(on, **settings):
    def colour(tree):
        if not on:
            even = add(tree, "ShaderNodeRGB")
            even.outputs[0].default_value = (0.4, 0.5, 0.7, 1)
            return even.outputs[0]
        return add(tree, "ShaderNodeTexSky", **settings).outputs[0]

    _lit(_background(colour, 0.2))


@scene(since=(5, 0))
def sky_of_multiple_scattering(on):
    _sky(on, sky_type="MULTIPLE_SCATTERING", sun_disc=False, sun_elevation=0.4)


@scene(since=(5, 0))
def sky_of_single_scattering(on):
    _sky(on, sky_type="SINGLE_SCATTERING", sun_disc=False, sun_elevation=0.4)


@scene(since=(5, 0))
def sky_with_its_sun(on):
    _sky(on, sky_type="MULTIPLE_SCATTERING", sun_elevation=0.7, sun_rotation=1.0)


@scene()
def sky_of_hosek_and_wilkie(on):
    _sky(on, sky_type="HOSEK_WILKIE", sun_direction=(0.5, 0.3, 0.8))


@scene()
def sky_of_preetham(on):
    _sky(on, sky_type="PREETHAM", sun_direction=(0.5, 0.3, 0.8))


# ---- gradients and images


def _direction(tree):
    return add(tree, "ShaderNodeTexCoord").outputs["Generated"]


@scene(quick=True)
def gradient(on):
    def colour(tree):
        height = add(tree, "ShaderNodeSeparateXYZ", {0: _direction(tree)}).outputs["X"]
        ramp = add(tree, "ShaderNodeValToRGB", {0: height})
        ramp.color_ramp.elements[0].color = (0.1, 0.2, 0.6, 1)
        ramp.color_ramp.elements[1].color = (1.0, 0.8, 0.5, 1)
        ramp.color_ramp.elements[0].position = 0.0 if on else 0.99
        return ramp.outputs[0]

    _lit(_background(colour))


@scene()
def clouds_of_noise(on):
    def colour(tree):
        noise = {"Vector": _direction(tree), "Scale": 2.0, "Detail": 1.0}
        return add(tree, "ShaderNodeTexNoise", noise).outputs["Color"]

    _lit(_background(colour if on else None, 1.0))


def _panorama():
    """A smooth picture of a whole sky, with a bright side."""
    y, x = np.mgrid[0:32, 0:64]
    bright = 0.5 + 0.5 * np.cos(2 * np.pi * x / 64)
    return np.stack([bright, 0.3 + 0 * x, 0.9 - 0.8 * y / 31], axis=-1)


def _environment(on, projection="EQUIRECTANGULAR", rotation=None, linear=True):
    def colour(tree):
        inputs = {}
        if rotation is not None:
            turn = {"Vector": _direction(tree), "Rotation": rotation if on else (0, 0, 0)}
            inputs["Vector"] = add(tree, "ShaderNodeMapping", turn).outputs[0]
        picture = image("panorama", _panorama(), linear)
        kind = "ShaderNodeTexEnvironment"
        return add(tree, kind, inputs, image=picture, projection=projection).outputs[0]

    return _background(colour)


@scene(quick=True)
def environment_image(on):
    _lit(_environment(on) if on else None)


@scene(quick=True)
def environment_image_turned(on):
    _lit(_environment(on, rotation=(0, 0, 2.0)))


@scene()
def environment_image_tilted(on):
    _lit(_environment(on, rotation=(0.9, 0.4, 0.3)))


@scene()
def environment_image_of_a_mirror_ball(on):
    _lit(_environment(on, "MIRROR_BALL" if on else "EQUIRECTANGULAR"))


@scene()
def environment_image_in_sRGB(on):
    _lit(_environment(on, linear=not on))


@scene(quick=True)
def environment_image_of_coarse_bytes(on):
    def colour(tree):
        kind, picture = "ShaderNodeTexEnvironment", image("coarse", patches(16, 8))
        between = "Linear" if on else "Closest"
        return add(tree, kind, image=picture, interpolation=between).outputs[0]

    _lit(_background(colour))


@scene()
def environment_image_with_alpha(on):
    def colour(tree):
        clear = np.full((32, 64, 1), 0.5 if on else 1.0)
        picture = image("clear", np.concatenate([_panorama(), clear], axis=-1))
        return add(tree, "ShaderNodeTexEnvironment", image=picture).outputs[0]

    _lit(_background(colour))


@scene(says=("gone.exr",), quick=True)
def environment_image_that_is_missing(on):
    def colour(tree):
        picture = bpy.data.images.new("gone.exr", 4, 4)
        picture.source, picture.filepath = "FILE", f"{bpy.app.tempdir}gone.exr"
        return add(tree, "ShaderNodeTexEnvironment", image=picture).outputs[0]

    _lit(_background(colour if on else None))


@scene(samples=4096)
def environment_image_with_a_small_sun(on):
    pixels = np.full((64, 128, 3), 0.3, np.float32)
    pixels[14:16, 40:42] = (200.0, 180.0, 150.0) if on else 0.3

    def colour(tree):
        picture = bpy.data.images.new("sunny", 128, 64, float_buffer=True)
        rgba = np.ones((64, 128, 4), np.float32)
        rgba[..., :3] = pixels[::-1]
        picture.pixels.foreach_set(rgba.ravel())
        picture.pack()
        return add(tree, "ShaderNodeTexEnvironment", image=picture).outputs[0]

    _lit(_background(colour))


# ---- mixes


def _two(first, second, factor):
    """A mix of two Backgrounds."""

    def surface(tree):
        backgrounds = [
            add(tree, "ShaderNodeBackground", {"Color": (*c, 1)}).outputs[0]
            for c in (first, second)
        ]
        mix = {0: factor(tree), 1: backgrounds[0], 2: backgrounds[1]}
        return add(tree, "ShaderNodeMixShader", mix).outputs[0]

    return surface


BLUISH, WARM = (0.2, 0.4, 1.0), (1.0, 0.6, 0.2)


@scene(quick=True)
def world_that_only_the_camera_sees(on):
    def camera(tree):
        return add(tree, "ShaderNodeLightPath").outputs["Is Camera Ray"] if on else 0.5

    _lit(_two(BLUISH, WARM, camera))


@scene()
def world_that_only_diffuse_rays_see(on):
    def diffuse(tree):
        return add(tree, "ShaderNodeLightPath").outputs["Is Diffuse Ray"] if on else 0.0

    _lit(_two(BLUISH, WARM, diffuse))


@scene()
def world_that_only_glossy_rays_see(on):
    def glossy(tree):
        return add(tree, "ShaderNodeLightPath").outputs["Is Glossy Ray"] if on else 1.0

    _lit(_two(BLUISH, WARM, glossy))


@scene(quick=True)
def two_backgrounds_mixed(on):
    _lit(_two(BLUISH, WARM, lambda tree: 0.7 if on else 0.0))


@scene()
def two_backgrounds_mixed_by_height(on):
    def height(tree):
        return add(tree, "ShaderNodeSeparateXYZ", {0: _direction(tree)}).outputs["Y"] if on else 0.5

    _lit(_two(BLUISH, WARM, height))


@scene()
def two_backgrounds_added(on):
    def surface(tree):
        first, second = (
            add(tree, "ShaderNodeBackground", {"Color": (*c, 1)}).outputs[0] for c in (BLUISH, WARM)
        )
        return add(
            tree, "ShaderNodeAddShader", {0: first, 1: second} if on else {0: first}
        ).outputs[0]

    _lit(surface)


@scene()
def strength_by_nodes(on):
    def strength(tree):
        return add(tree, "ShaderNodeMath", {0: 2.0, 1: 1.5}, operation="MULTIPLY").outputs[0]

    _lit(_background(None, strength if on else 1.0))


@scene(quick=True)
def background_in_a_group(on):
    group = bpy.data.node_groups.new("sky", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    shine = add(group, "ShaderNodeBackground", {"Color": (*WARM, 1)}).outputs[0]
    add(group, "NodeGroupOutput", {0: shine})

    def surface(tree):
        if on:
            return add(tree, "ShaderNodeGroup", node_tree=group).outputs[0]
        return add(tree, "ShaderNodeBackground").outputs[0]

    _lit(surface)


@scene()
def emission_as_a_world(on):
    def surface(tree):
        kind = "ShaderNodeEmission" if on else "ShaderNodeBackground"
        return add(tree, kind, {0: (*(WARM if on else BLUISH), 1)}).outputs[0]

    _lit(surface)


@scene()
def sky_above_a_dark_ground(on):
    def factor(tree):
        height = add(tree, "ShaderNodeSeparateXYZ", {0: _direction(tree)}).outputs["Z"]
        above = {0: height, 1: 0.5}
        return (
            add(tree, "ShaderNodeMath", above, operation="GREATER_THAN").outputs[0] if on else 1.0
        )

    _lit(_two((0, 0, 0), WARM, factor))


@scene()
def world_driven_by_the_frame(on):
    _lit()
    tree = bpy.context.scene.world.node_tree
    socket = next(n for n in tree.nodes if n.type == "BACKGROUND").inputs["Strength"]
    socket.driver_add("default_value").driver.expression = "0.1 * frame" if on else "1.0"
    bpy.context.scene.frame_set(25)


@scene(light="lamps", says=("world", "volume"), samples=4096)
def fog_of_the_world(on):
    ground()
    lamp("lamp", "SPOT", (0, 0, 2), 300, spot_size=math.pi / 2)
    tree = world(0.0).node_tree
    fog = add(tree, "ShaderNodeVolumeAbsorption", {"Density": 0.5 * on}).outputs[0]
    output = next(n for n in tree.nodes if n.type == "OUTPUT_WORLD")
    tree.links.new(fog, output.inputs["Volume"])


@scene()
def world_dimmed_by_a_property_of_the_scene(on):
    def strength(tree):
        kind, of = "ShaderNodeAttribute", {"attribute_type": "VIEW_LAYER"}
        return add(tree, kind, attribute_name="dimmed", **of).outputs["Fac"]

    _lit(_background(None, strength))
    bpy.context.scene["dimmed"] = 0.3 if on else 1.0


@scene(says=("world", "count bounces"))
def world_that_counts_bounces(on):
    def strength(tree):
        return add(tree, "ShaderNodeLightPath").outputs["Diffuse Depth"]

    _lit(_background(None, strength if on else 1.0))


@scene(says=("world", "below zero"))
def world_below_zero_on_one_side(on):
    def colour(tree):
        way = add(tree, "ShaderNodeVectorMath", {0: _direction(tree)}, operation="ABSOLUTE")
        return _direction(tree) if on else way.outputs[0]

    _lit(_background(colour))
