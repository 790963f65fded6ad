"""What surfaces look like: Principled, other shaders, textures, coordinates, colour nodes."""

import bpy
import numpy as np

from tests.conformance.parts import (
    BLUE,
    GREEN,
    GREY,
    RED,
    add,
    ball,
    box,
    geometry_nodes,
    grid,
    ground,
    image,
    lamp,
    painted,
    patches,
    plain,
    plate,
    principled,
    put,
    shaded,
    shader,
    wall,
    world,
)
from tests.conformance.scene import scene

BESIDE = {"scale": (1, 1, 1), "location": (-2, 0, 2)}


# ---- the inputs of Principled


@scene(quick=True)
def principled_base_colour(on):
    ground(principled("ground", {"Base Color": (*(BLUE if on else GREY), 1)})), world()


@scene(says=("wall", "specular"))
def principled_metal(on):
    # Metal whose diffuse colour alone is looked at is black.
    metal = {"Base Color": (*(RED if on else (0, 0, 0)), 1), "Metallic": 1.0, "Roughness": 0.6}
    ground(), wall(principled("wall", metal), **BESIDE), world()


@scene(says=("ground", "specular"))
def principled_specular(on):
    gloss = {"Base Color": (*BLUE, 1), "Specular IOR Level": 1.0 if on else 0.0, "Roughness": 0.5}
    gloss |= {"IOR": 2.5}
    ground(principled("ground", gloss)), world()


@scene(light="lamps", says=("ground", "roughness"), since=(4, 3))
def principled_diffuse_roughness(on):
    rough = {"Base Color": (*GREY, 1), "Diffuse Roughness": float(on)}
    ground(principled("ground", rough))
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0, 1.3, 0))


@scene(targets=("wall",), says=("wall", "subsurface"), samples=4096)
def principled_subsurface(on):
    skin = {"Base Color": (*GREEN, 1), "Subsurface Weight": float(on), "Subsurface Scale": 1.0}
    wall(principled("wall", skin), **BESIDE), ground(), world()


@scene(says=("ground", "sheen"))
def principled_sheen(on):
    (
        ground(
            principled(
                "ground",
                {"Base Color": (*GREEN, 1), "Sheen Weight": float(on), "Sheen Roughness": 1.0},
            )
        ),
        world(),
    )


@scene(says=("ground", "coat"))
def principled_coat(on):
    coat = {"Base Color": (*GREEN, 1), "Coat Weight": float(on), "Coat IOR": 2.5}
    ground(principled("ground", coat)), world()


@scene(says=("ground", "transmission"))
def principled_transmission(on):
    (
        ground(principled("ground", {"Base Color": (*GREEN, 1), "Transmission Weight": 0.5 * on})),
        world(),
    )


@scene()
def principled_emission(on):
    glow = {"Base Color": (*GREY, 1), "Emission Color": (1, 0.3, 0.1, 1)}
    glow["Emission Strength"] = 2.0 * on
    ground(), world(0.5)
    plate(material=principled("plate", glow), location=(0, 0, 0.7))


@scene()
def principled_of_glTF_defaults(on):
    # As importers write it: metal by a number, roughness 1, the factor of the base colour mixed in.
    def surface(tree):
        factor = add(tree, "ShaderNodeMix", data_type="RGBA", blend_type="MULTIPLY")
        factor.inputs[0].default_value = 1
        factor.inputs[6].default_value = (*GREY, 1)
        factor.inputs[7].default_value = (0.9, 0.4, 0.2, 1) if on else (1, 1, 1, 1)
        inputs = {"Base Color": factor.outputs[2], "Metallic": 0.0, "Roughness": 1.0}
        inputs["Specular IOR Level"] = 0.0
        return add(tree, "ShaderNodeBsdfPrincipled", inputs).outputs[0]

    ground(shaded("ground", surface)), world()


# ---- other shaders


@scene(light="lamps", says=("ground", "roughness"))
def rough_diffuse(on):
    ground(shader("ground", "ShaderNodeBsdfDiffuse", {"Color": (*GREY, 1), "Roughness": float(on)}))
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0, 1.3, 0))


@scene(says=("wall", "specular"))
def glossy_shader(on):
    gloss = {"Color": (*(RED if on else (0, 0, 0)), 1), "Roughness": 0.6}
    ground(), wall(shader("wall", "ShaderNodeBsdfAnisotropic", gloss), **BESIDE), world()


@scene(light="lamps", says=("ground", "toon"))
def toon_shader(on):
    toon = {"Color": (*GREY, 1), "Size": 0.6}
    kind = "ShaderNodeBsdfToon" if on else "ShaderNodeBsdfDiffuse"
    ground(shader("ground", kind, toon if on else {"Color": (*GREY, 1)}))
    lamp("lamp", "POINT", (0, 0, 1), 50)


@scene(says=("wall", "sheen"))
def sheen_shader(on):
    kind = "ShaderNodeBsdfSheen" if on else "ShaderNodeBsdfDiffuse"
    ground(), wall(shader("wall", kind, {"Color": (*RED, 1)}), **BESIDE), world()


@scene(says=("ground", "subsurface"), samples=8192)
def subsurface_shader(on):
    kind = "ShaderNodeSubsurfaceScattering" if on else "ShaderNodeBsdfDiffuse"
    ground(shader("ground", kind, {"Color": (*GREY, 1)})), world()


@scene(quick=True)
def mix_of_two_diffuse(on):
    def surface(tree):
        red = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*RED, 1)}).outputs[0]
        blue = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*BLUE, 1)}).outputs[0]
        return add(tree, "ShaderNodeMixShader", {0: 0.75 * on, 1: red, 2: blue}).outputs[0]

    ground(shaded("ground", surface)), world()


@scene()
def sum_of_two_diffuse(on):
    def surface(tree):
        red = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (0.5, 0.1, 0.1, 1)}).outputs[0]
        blue = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (0.1, 0.1, 0.4, 1)}).outputs[0]
        return add(tree, "ShaderNodeAddShader", {0: red, 1: blue} if on else {0: red}).outputs[0]

    ground(shaded("ground", surface)), world()


@scene()
def mix_by_a_texture(on):
    def surface(tree):
        red = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*RED, 1)}).outputs[0]
        blue = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*BLUE, 1)}).outputs[0]
        uv = add(tree, "ShaderNodeTexCoord").outputs["UV"]
        factor = add(tree, "ShaderNodeTexGradient", {0: uv}).outputs[0] if on else 0.5
        return add(tree, "ShaderNodeMixShader", {0: factor, 1: red, 2: blue}).outputs[0]

    ground(shaded("ground", surface)), world()


@scene()
def output_for_cycles(on):
    material = plain("ground", GREY)
    tree = material.node_tree
    if on:
        other = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*GREEN, 1)}).outputs[0]
        add(tree, "ShaderNodeOutputMaterial", {"Surface": other}, target="CYCLES")
        tree.nodes[1].target = "EEVEE"
    ground(material), world()


@scene()
def two_outputs_of_which_one_is_active(on):
    material = plain("ground", GREY)
    tree = material.node_tree
    other = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*GREEN, 1)}).outputs[0]
    output = add(tree, "ShaderNodeOutputMaterial", {"Surface": other})
    output.is_active_output = on
    ground(material), world()


@scene()
def output_without_a_surface(on):
    material = plain("wall", RED)
    if on:
        material.node_tree.links.clear()
    ground(), wall(material, **BESIDE), world()


# ---- which material


@scene(quick=True)
def slots_by_face(on):
    ground(), world()
    item = wall(plain("wall", RED), **BESIDE)
    item.data.materials.append(plain("other", BLUE))
    item.data.polygons.foreach_set("material_index", [int(on)] * len(item.data.polygons))


@scene(targets=("ground", "wall"))
def slots_that_are_empty_or_missing(on):
    ground(), world()
    item = wall(plain("wall", RED), **BESIDE)
    item.data.materials.append(None)
    slots = [0, 1, 2, 7] if on else [0] * 4
    item.data.polygons.foreach_set("material_index", slots * (len(item.data.polygons) // 4))


@scene()
def slot_of_the_object(on):
    ground(), world()
    slot = wall(plain("wall", RED), **BESIDE).material_slots[0]
    if on:
        slot.link, slot.material = "OBJECT", plain("other", BLUE)


@scene()
def slot_by_geometry_nodes(on):
    ground(), world()
    item = wall(plain("wall", RED), **BESIDE)
    item.data.materials.append(plain("other", BLUE))
    if on:
        geometry_nodes(item, lambda tree, geometry: add(
            tree, "GeometryNodeSetMaterialIndex", {"Geometry": geometry, "Material Index": 1}
        ).outputs[0])  # fmt: skip


@scene()
def no_material(on):
    ground(), world()
    item = wall(plain("wall", RED), **BESIDE)
    if on:
        item.data.materials.clear()


@scene(targets=("ground", "first", "second"))
def one_mesh_of_two_objects(on):
    ground(), world()
    first = grid("first", 4, 1.5, plain("red", RED), location=(-1.5, 0, 0.8))
    second = put("second", first.data, location=(1.5, 0, 0.8))
    if on:
        slot = second.material_slots[0]
        slot.link, slot.material = "OBJECT", plain("blue", BLUE)


# ---- image textures


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
    ground(_textured(image("tiles", patches() if on else np.full((4, 4, 3), 0.5)))), world()


@scene(quick=True)
def image_through_mapping(on):
    turned = {"Rotation": (0, 0, 0.5), "Scale": (1.7, 0.8, 1)} if on else {}
    ground(_textured(image("tiles", patches()), _mapped(**ASIDE, **turned))), world()


@scene()
def image_of_closest_texels(on):
    kind = "Closest" if on else "Cubic"
    ground(_textured(image("tiles", patches(7, 5)), _mapped(**ASIDE), interpolation=kind)), world()


@scene()
def image_of_cubic_interpolation(on):
    kind = "Cubic" if on else "Closest"
    ground(_textured(image("tiles", patches(7, 5)), _mapped(**ASIDE), interpolation=kind)), world()


def _extension(on, kind):
    far = _mapped(Scale=(1.9, 1.9, 1), Location=(-0.52, -0.33, 0))
    kind = kind if on else ("REPEAT" if kind != "REPEAT" else "CLIP")
    ground(_textured(image("tiles", patches()), far, extension=kind)), world()


@scene()
def image_that_repeats(on):
    _extension(on, "REPEAT")


@scene()
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
    ground(_textured(image("tiles", patches(seed=2) * 0.4, linear=on))), world()


@scene(targets=("ball", "ground"))
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


@scene()
def image_with_transparent_texels(on):
    pixels = np.full((8, 8, 4), 0.7)
    pixels[:, 3:, 3] = 0
    ground(_textured(image("decal", pixels if on else pixels[..., :3]), interpolation="Closest"))
    world()


@scene()
def image_generated_by_blender(on):
    picture = bpy.data.images.new("grid", 64, 64)
    picture.generated_type = "COLOR_GRID" if on else "BLANK"
    ground(_textured(picture, _mapped(**ASIDE))), world()


@scene(says=("gone.png",))
def image_that_is_missing(on):
    picture = image("tiles", patches())
    if on:
        picture = bpy.data.images.new("gone", 4, 4)
        picture.source, picture.filepath = "FILE", f"{bpy.app.tempdir}gone.png"
    ground(_textured(picture)), world()


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
    ground(_textured(picture, wide)), world()


@scene(quick=True)
def image_file_beside_the_scene(on):
    picture = image("tiles", patches() if on else patches(seed=3))
    picture.filepath_raw, picture.file_format = f"{bpy.app.tempdir}beside.png", "PNG"
    picture.save()
    picture = bpy.data.images.load(picture.filepath_raw)
    ground(_textured(picture)), world()


@scene()
def image_of_floats(on):
    picture = bpy.data.images.new("floats", 4, 4, float_buffer=True)
    rgba = np.ones((4, 4, 4), np.float32)
    rgba[..., :3] = patches() if on else 0.5
    picture.pixels.foreach_set(rgba.ravel())
    picture.pack()
    ground(_textured(picture)), world()


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


# ---- procedural textures and coordinates


def _pattern(kind, source="Generated", output="Color", inputs=(), **settings):
    """The ground painted by a procedural texture in some coordinates."""

    def colour(tree):
        vector = add(tree, "ShaderNodeTexCoord").outputs[source]
        node = add(tree, kind, {"Vector": vector, **dict(inputs)}, **settings)
        return node.outputs[output]

    return painted("ground", colour)


@scene(quick=True)
def noise_in_generated_coordinates(on):
    ground(_pattern("ShaderNodeTexNoise", inputs={"Scale": 3.0}) if on else None), world()


@scene()
def noise_in_object_coordinates(on):
    scale = {"Scale": 1.3}
    ground(
        _pattern("ShaderNodeTexNoise", "Object" if on else "UV", inputs=scale), rotation=(0, 0, 1)
    )
    world()


@scene()
def voronoi_by_the_uv_map(on):
    ground(_pattern("ShaderNodeTexVoronoi", "UV" if on else "Object", inputs={"Scale": 2.3}))
    world()


@scene(targets=("ball",))
def wave_along_the_normal(on):
    ball("ball", _pattern("ShaderNodeTexWave", "Normal" if on else "Generated", 0,
                          {"Scale": 0.4, "Distortion": 2.0}))  # fmt: skip
    world()


@scene()
def bricks(on):
    ground(_pattern("ShaderNodeTexBrick", "UV", inputs={"Scale": 2.3}) if on else None), world()


@scene()
def checker(on):
    ground(_pattern("ShaderNodeTexChecker", "UV", inputs={"Scale": 4.7}) if on else None), world()


@scene()
def magic(on):
    ground(_pattern("ShaderNodeTexMagic", "Object", inputs={"Scale": 2.0}) if on else None)
    world()


@scene()
def gradient_in_the_space_of_another_object(on):
    other = put("other", None, location=(-0.7, 0.4, 0), rotation=(0, 0, 0.7), scale=(2, 2, 2))

    def colour(tree):
        vector = add(tree, "ShaderNodeTexCoord", object=other if on else None).outputs["Object"]
        return add(tree, "ShaderNodeTexGradient", {"Vector": vector}).outputs[0]

    ground(painted("ground", colour)), world()


@scene()
def white_noise_of_the_position(on):
    def colour(tree):
        position = add(tree, "ShaderNodeNewGeometry").outputs["Position"]
        cell = add(tree, "ShaderNodeVectorMath", {0: position, 1: (0.9, 0.9, 9)}, operation="SNAP")
        noise = add(tree, "ShaderNodeTexWhiteNoise", {"Vector": cell.outputs[0]})
        return noise.outputs["Color" if on else "Value"]

    ground(painted("ground", colour), location=(0.013, 0.017, 0.1)), world()


@scene()
def coordinates_of_the_texture_space(on):
    item = ground(_pattern("ShaderNodeTexGradient"))
    if on:
        item.data.use_auto_texspace = False
        item.data.texspace_location, item.data.texspace_size = (1, 0, 0), (2.5, 2.5, 2.5)
    world()


# ---- attributes


@scene(quick=True)
def colour_attribute_by_name(on):
    item = ground(painted("ground", lambda tree: add(
        tree, "ShaderNodeVertexColor", layer_name="paint" if on else "other"
    ).outputs[0]))  # fmt: skip
    _colours(item, "other", (0.5, 0.5, 0.5), "BYTE_COLOR", "CORNER")
    _colours(item, "paint", None, "BYTE_COLOR", "CORNER")
    world()


@scene()
def colour_attribute_for_renders(on):
    item = ground(painted("ground", lambda tree: add(tree, "ShaderNodeVertexColor").outputs[0]))
    _colours(item, "first", (0.8, 0.1, 0.1))
    _colours(item, "second", (0.1, 0.1, 0.8))
    item.data.color_attributes.render_color_index = int(on)
    item.data.color_attributes.active_color_index = 0
    world()


def _colours(item, name, colour=None, kind="FLOAT_COLOR", domain="POINT"):
    data = item.data.color_attributes.new(name, kind, domain).data
    rgba = np.ones((len(data), 4), np.float32)
    rgba[:, :3] = (
        np.random.default_rng(1).uniform(0, 1, (len(data), 3)) if colour is None else colour
    )
    data.foreach_set("color", rgba.ravel())


def _attribute(on, kind, domain, values):
    """The ground painted by an attribute of this domain."""
    item = ground(painted("ground", lambda tree: add(
        tree, "ShaderNodeAttribute", attribute_name="paint"
    ).outputs["Color"]))  # fmt: skip
    data = item.data.attributes.new("paint", kind, domain).data
    values = np.asarray(
        values(len(data)) if on else np.full_like(values(len(data)), 0.5), np.float32
    )
    data.foreach_set("vector" if kind == "FLOAT_VECTOR" else "value", values.ravel())
    world()


@scene()
def attribute_of_faces(on):
    _attribute(on, "FLOAT_VECTOR", "FACE", lambda n: np.linspace(0, 1, 3 * n).reshape(n, 3))


@scene()
def attribute_of_points(on):
    _attribute(on, "FLOAT", "POINT", lambda n: np.linspace(0, 1, n))


@scene()
def attribute_of_corners(on):
    _attribute(
        on, "FLOAT_VECTOR", "CORNER", lambda n: np.random.default_rng(5).uniform(0, 1, (n, 3))
    )


@scene()
def attribute_of_the_object(on):
    item = ground(painted("ground", lambda tree: add(
        tree, "ShaderNodeAttribute", attribute_name="paint", attribute_type="OBJECT"
    ).outputs["Color"]))  # fmt: skip
    item["paint"] = [0.1, 0.7, 0.3] if on else [0.5, 0.5, 0.5]
    world()


@scene()
def colour_of_the_object(on):
    item = ground(
        painted("ground", lambda tree: add(tree, "ShaderNodeObjectInfo").outputs["Color"])
    )
    item.color = (0.1, 0.7, 0.3, 1) if on else (0.5, 0.5, 0.5, 1)
    world()


@scene()
def attribute_of_the_instancer(on):
    ground(), world()
    seeds = grid("seeds", 1, 2.4, location=(0, 0, 0.4))
    tinted = painted("cubes", lambda tree: add(
        tree, "ShaderNodeAttribute", attribute_name="tint", attribute_type="INSTANCER"
    ).outputs["Color"])  # fmt: skip

    def instances(tree, geometry):
        cube = add(tree, "GeometryNodeMeshCube", {"Size": (0.8, 0.8, 0.8)}).outputs[0]
        paint = {"Geometry": cube, "Material": tinted}
        cube = add(tree, "GeometryNodeSetMaterial", paint).outputs[0]
        kind = {"data_type": "FLOAT_COLOR", "domain": "INSTANCE"}
        put_on = {"Points": geometry, "Instance": cube}
        cubes = add(tree, "GeometryNodeInstanceOnPoints", put_on).outputs[0]
        store = {"Geometry": cubes, "Name": "tint"}
        node = add(tree, "GeometryNodeStoreNamedAttribute", store, **kind)
        value = next(s for s in node.inputs if s.enabled and s.name == "Value")
        value.default_value = (0.9, 0.1, 0.1, 1) if on else (0.1, 0.1, 0.1, 1)
        return node.outputs[0]

    geometry_nodes(seeds, instances)


@scene()
def random_of_the_object(on):
    def colour(tree):
        info = add(tree, "ShaderNodeObjectInfo")
        ramp = add(tree, "ShaderNodeValToRGB", {0: info.outputs["Random"] if on else 0.0})
        ramp.color_ramp.elements[0].color = (0.9, 0.1, 0.1, 1)
        ramp.color_ramp.elements[1].color = (0.1, 0.1, 0.9, 1)
        return ramp.outputs[0]

    ground(), world()
    material = painted("cubes", colour)
    for number, x in enumerate((-1.2, 0, 1.2)):
        box(f"box {number}", material, 0.8, location=(x, 0, 0.5))


# ---- nodes that change colours, groups, wiring


def _changed(on, change, colour=RED):
    """The ground painted by what `change(tree, socket)` makes of a colour."""

    def result(tree):
        first = add(tree, "ShaderNodeRGB")
        first.outputs[0].default_value = (*colour, 1)
        return change(tree, first.outputs[0]) if on else first.outputs[0]

    ground(painted("ground", result)), world()


@scene()
def colour_ramp(on):
    def colour(tree):
        position = add(tree, "ShaderNodeTexCoord").outputs["UV"]
        factor = add(tree, "ShaderNodeTexGradient", {0: position}).outputs[0]
        ramp = add(tree, "ShaderNodeValToRGB", {0: factor})
        middle = ramp.color_ramp.elements.new(0.35)
        middle.color = (0.9, 0.1, 0.1, 1)
        ramp.color_ramp.interpolation = "EASE"
        return ramp.outputs[0] if on else factor

    ground(painted("ground", colour)), world()


@scene()
def hue_and_saturation(on):
    _changed(on, lambda tree, colour: add(
        tree, "ShaderNodeHueSaturation", {"Hue": 0.8, "Saturation": 0.6, "Color": colour}
    ).outputs[0])  # fmt: skip


@scene()
def colour_curves(on):
    def curved(tree, colour):
        node = add(tree, "ShaderNodeRGBCurve", {"Color": colour})
        node.mapping.curves[0].points[1].location = 1, 0.4
        node.mapping.curves[2].points[0].location = 0, 0.3
        node.mapping.update()
        return node.outputs[0]

    _changed(on, curved)


@scene()
def brightness_gamma_and_inversion(on):
    def changed(tree, colour):
        inverted = add(tree, "ShaderNodeInvert", {"Color": colour}).outputs[0]
        gamma = add(tree, "ShaderNodeGamma", {"Color": inverted, "Gamma": 1.8}).outputs[0]
        return add(tree, "ShaderNodeBrightContrast", {"Color": gamma, "Contrast": -0.3}).outputs[0]

    _changed(on, changed)


def _blend(on, kind):
    def mixed(tree, colour):
        node = add(tree, "ShaderNodeMix", data_type="RGBA", blend_type=kind)
        node.inputs[0].default_value = 0.8
        tree.links.new(colour, node.inputs[6])
        node.inputs[7].default_value = (0.3, 0.8, 0.5, 1)
        return node.outputs[2]

    _changed(on, mixed, (0.7, 0.4, 0.2))


@scene()
def mix_multiply(on):
    _blend(on, "MULTIPLY")


@scene()
def mix_overlay(on):
    _blend(on, "OVERLAY")


@scene()
def mix_difference(on):
    _blend(on, "DIFFERENCE")


@scene()
def mix_hue(on):
    _blend(on, "HUE")


@scene()
def separate_and_combine(on):
    def swapped(tree, colour):
        parts = add(tree, "ShaderNodeSeparateColor", {0: colour}).outputs
        return add(tree, "ShaderNodeCombineColor", {0: parts[2], 1: parts[1], 2: parts[0]}).outputs[
            0
        ]

    _changed(on, swapped)


@scene()
def blackbody_as_a_colour(on):
    _changed(
        on, lambda tree, colour: add(tree, "ShaderNodeBlackbody", {0: 2500.0}).outputs[0], GREY
    )


def _group(name, inner):
    """A node group of one colour that goes through `inner(tree, socket)`."""
    group = bpy.data.node_groups.new(name, "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    source = add(group, "NodeGroupInput").outputs[0]
    add(group, "NodeGroupOutput", {0: inner(group, source)})
    return group


@scene(quick=True)
def nested_groups(on):
    def inverted(tree, colour):
        return add(tree, "ShaderNodeInvert", {"Color": colour}).outputs[0]

    inner = _group("inner", inverted)

    def nested(tree, colour):
        return add(tree, "ShaderNodeGroup", {0: colour}, node_tree=inner).outputs[0]

    outer = _group("outer", nested)
    _changed(on, lambda tree, colour: add(
        tree, "ShaderNodeGroup", {0: colour}, node_tree=outer).outputs[0])  # fmt: skip


@scene()
def muted_node(on):
    def colour(tree):
        first = add(tree, "ShaderNodeRGB")
        first.outputs[0].default_value = (*RED, 1)
        inverted = add(tree, "ShaderNodeInvert", {"Color": first.outputs[0]}, mute=on)
        return inverted.outputs[0]

    ground(painted("ground", colour)), world()


@scene()
def reroutes(on):
    def routed(tree, colour):
        first = add(tree, "NodeReroute", {0: colour}).outputs[0]
        return add(tree, "NodeReroute", {0: first}).outputs[0]

    def result(tree):
        red = add(tree, "ShaderNodeRGB")
        red.outputs[0].default_value = (*RED, 1)
        return routed(tree, red.outputs[0])

    ground(painted("ground", result) if on else None), world()


@scene()
def muted_link(on):
    material = painted(
        "ground", lambda tree: add(tree, "ShaderNodeBlackbody", {0: 2500.0}).outputs[0]
    )
    for link in material.node_tree.links:
        if link.to_socket.name == "Color":
            link.is_muted = on
    ground(material), world()


@scene()
def value_driven_by_the_frame(on):
    material = painted("ground", lambda tree: add(tree, "ShaderNodeCombineColor").outputs[0])
    node = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeCombineColor")
    if on:
        node.inputs[1].driver_add("default_value").driver.expression = "0.1 * frame"
    node.inputs[0].default_value = 0.3
    ground(material), world()
    bpy.context.scene.frame_set(8)


# ---- the direction of a surface


@scene(light="lamps")
def normal_map(on):
    def surface(tree):
        tilted = image("normals", np.tile((0.85, 0.5, 0.857), (4, 4, 1)), linear=True)
        texture = add(tree, "ShaderNodeTexImage", image=tilted).outputs[0]
        normal = add(tree, "ShaderNodeNormalMap", {"Color": texture}).outputs[0]
        inputs = {"Color": (*GREY, 1)} | ({"Normal": normal} if on else {})
        return add(tree, "ShaderNodeBsdfDiffuse", inputs).outputs[0]

    ground(shaded("ground", surface))
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0, 0.8, 0))


@scene(targets=("ball",))
def colour_by_the_normal(on):
    def colour(tree):
        normal = add(tree, "ShaderNodeNewGeometry").outputs["Normal" if on else "Position"]
        return add(tree, "ShaderNodeVectorMath", {0: normal}, operation="ABSOLUTE").outputs[0]

    ball("ball", painted("ball", colour), location=(0.3, 0.2, 0.1)), world()


@scene()
def colour_by_the_side_that_is_seen(on):
    def colour(tree):
        back = add(tree, "ShaderNodeNewGeometry").outputs["Backfacing"]
        node = add(tree, "ShaderNodeMix", data_type="RGBA")
        tree.links.new(back, node.inputs[0])
        node.inputs[6].default_value = (*BLUE, 1)
        node.inputs[7].default_value = (*(RED if on else BLUE), 1)
        return node.outputs[2]

    ground(), world()
    wall(painted("wall", colour), **BESIDE, rotation=(0, -np.pi / 2, 0))


@scene()
def colour_that_only_the_camera_sees(on):
    def colour(tree):
        seen = add(tree, "ShaderNodeLightPath").outputs["Is Camera Ray"]
        node = add(tree, "ShaderNodeMix", data_type="RGBA")
        tree.links.new(seen, node.inputs[0])
        node.inputs[6].default_value = (*(RED if on else BLUE), 1)
        node.inputs[7].default_value = (*BLUE, 1)
        return node.outputs[2]

    ground(), wall(painted("wall", colour), **BESIDE), world()
