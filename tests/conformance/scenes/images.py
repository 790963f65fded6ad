"""Image textures: projections, borders, files, UV maps."""

import bpy
import numpy as np

from tests.conformance.parts import add, ball, grid, ground, image, painted, patches, world
from tests.conformance.scene import scene


def _textured(picture, uv=None, **settings):
    """A Diffuse BSDF with an image; `uv(tree)` gives the coordinates."""

    def colour(tree):
        inputs = {} if uv is None else {"Vector": uv(tree)}
        return add(tree, "ShaderNodeTexImage", inputs, image=picture, **settings).outputs[0]

    return painted("ground", colour)


def _mapped(source="UV", **inputs):
    """Coordinates through a Mapping node."""

    def vector(tree):
        coordinates = add(tree, "ShaderNodeTexCoord").outputs[source]
        return add(tree, "ShaderNodeMapping", {"Vector": coordinates, **inputs}).outputs[0]

    return vector


# Coordinates that put no vertex of the ground on the border of two texels.
ASIDE = {"Location": (0.013, 0.017, 0.0)}


@scene(quick=True)
def image_by_the_uv_map(on):
    ground(_textured(image("tiles", patches() if on else np.full((4, 4, 3), 0.5))))
    world()


@scene(quick=True)
def image_through_mapping(on):
    turned = {"Rotation": (0, 0, 0.5), "Scale": (1.7, 0.8, 1)} if on else {}
    ground(_textured(image("tiles", patches()), _mapped(**ASIDE, **turned)))
    world()


@scene()
def image_of_closest_texels(on):
    kind = "Closest" if on else "Cubic"
    ground(_textured(image("tiles", patches(7, 5)), _mapped(**ASIDE), interpolation=kind))
    world()


@scene()
def image_of_cubic_interpolation(on):
    kind = "Cubic" if on else "Closest"
    ground(_textured(image("tiles", patches(7, 5)), _mapped(**ASIDE), interpolation=kind))
    world()


def _extension(on, kind):
    far = _mapped(Scale=(1.9, 1.9, 1), Location=(-0.52, -0.33, 0))
    kind = kind if on else ("REPEAT" if kind != "REPEAT" else "CLIP")
    ground(_textured(image("tiles", patches()), far, extension=kind))
    world()


@scene()
def image_that_repeats(on):
    _extension(on, "REPEAT")


@scene(quick=True)
def image_that_extends(on):
    _extension(on, "EXTEND")


@scene()
def image_that_clips(on):
    _extension(on, "CLIP")


@scene()
def image_that_mirrors(on):
    _extension(on, "MIRROR")


@scene()
def image_of_data(on):
    ground(_textured(image("tiles", patches(seed=2) * 0.4, linear=on)))
    world()


@scene(targets=("ball", "ground"), quick=True)
def image_projected_on_a_box(on):
    world()
    ground()
    projection = {"projection": "BOX", "projection_blend": 0.3} if on else {}
    material = _textured(image("tiles", patches()), _mapped("Object", **ASIDE), **projection)
    ball("ball", material, 0.8, location=(0, 0, 0.9))


@scene(targets=("ball",))
def image_projected_on_a_sphere(on):
    world()
    projection = {"projection": "SPHERE"} if on else {}
    material = _textured(image("tiles", patches(8, 8)), _mapped("Generated"), **projection)
    ball("ball", material)


@scene(targets=("ball",))
def image_projected_on_a_tube(on):
    world()
    projection = {"projection": "TUBE"} if on else {}
    material = _textured(image("tiles", patches(8, 8)), _mapped("Generated"), **projection)
    ball("ball", material)


@scene(quick=True)
def image_with_transparent_texels(on):
    pixels = np.full((8, 8, 4), 0.7)
    pixels[:, 3:, 3] = 0
    ground(_textured(image("decal", pixels if on else pixels[..., :3]), interpolation="Closest"))
    world()


@scene()
def image_generated_by_blender(on):
    picture = bpy.data.images.new("grid", 64, 64)
    picture.generated_type = "COLOR_GRID" if on else "BLANK"
    ground(_textured(picture, _mapped(**ASIDE)))
    world()


@scene(says=("gone.png",))
def image_that_is_missing(on):
    picture = image("tiles", patches())
    if on:
        picture = bpy.data.images.new("gone", 4, 4)
        picture.source, picture.filepath = "FILE", f"{bpy.app.tempdir}gone.png"
    ground(_textured(picture))
    world()


@scene()
def image_in_tiles(on):
    picture = bpy.data.images.new("tiles", 4, 4, tiled=True)
    picture.tiles.new(tile_number=1002)
    picture.filepath_raw = f"{bpy.app.tempdir}tiles.<UDIM>.png"
    picture.file_format = "PNG"
    for number, colour in ((1001, (0.8, 0.1, 0.1)), (1002, (0.1, 0.1, 0.8))):
        tile = image("tile", np.tile(colour, (4, 4, 1)))
        tile.filepath_raw, tile.file_format = f"{bpy.app.tempdir}tiles.{number}.png", "PNG"
        tile.save()
    picture.source = "TILED"
    picture.reload()
    wide = _mapped(Scale=(1.9 if on else 0.9, 1, 1), Location=(0.013, 0, 0))
    ground(_textured(picture, wide))
    world()


@scene(quick=True)
def image_file_beside_the_scene(on):
    picture = image("tiles", patches() if on else patches(seed=3))
    picture.filepath_raw, picture.file_format = f"{bpy.app.tempdir}beside.png", "PNG"
    picture.save()
    picture = bpy.data.images.load(picture.filepath_raw)
    ground(_textured(picture))
    world()


@scene(quick=True)
def image_of_floats(on):
    picture = bpy.data.images.new("floats", 4, 4, float_buffer=True)
    rgba = np.ones((4, 4, 4), np.float32)
    rgba[..., :3] = patches() if on else 0.5
    picture.pixels.foreach_set(rgba.ravel())
    picture.pack()
    ground(_textured(picture))
    world()


@scene()
def uv_map_for_renders(on):
    item = ground(_textured(image("tiles", patches(seed=4)), _mapped(**ASIDE)))
    item.data.uv_layers.new(name="lightmap")
    _turn(item.data.uv_layers["lightmap"])
    item.data.uv_layers["lightmap"].active_render = on
    item.data.uv_layers.active_index = 0
    world()


@scene()
def uv_map_by_name(on):
    def named(tree):
        uv = add(tree, "ShaderNodeUVMap", uv_map="second" if on else "UVMap").outputs[0]
        return add(tree, "ShaderNodeMapping", {"Vector": uv, **ASIDE}).outputs[0]

    item = ground(_textured(image("tiles", patches(seed=4)), named))
    item.data.uv_layers.new(name="second")
    _turn(item.data.uv_layers["second"])
    item.data.uv_layers["UVMap"].active_render = True
    world()


def _turn(layer):
    """A UV map by a quarter turn."""
    uv = np.empty(len(layer.data) * 2, np.float32)
    layer.data.foreach_get("uv", uv)
    u, v = uv.reshape(-1, 2).T
    layer.data.foreach_set("uv", np.column_stack([1 - v, u]).ravel())


@scene()
def one_quad_whose_picture_lights_the_ceiling(on):
    # Its four vertices are black; the picture between them is not.
    pixels = np.full((16, 16, 3), 0.9)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 0
    material = painted("floor", lambda tree: add(
        tree, "ShaderNodeTexImage", image=image("frame", pixels if on else pixels * 0)
    ).outputs[0])  # fmt: skip
    grid("floor", 1, 4, material)
    ground(location=(0, 0, 1), rotation=(np.pi, 0, 0))
    world()
