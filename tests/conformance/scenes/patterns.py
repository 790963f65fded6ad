"""Procedural textures and the coordinates they are in."""

from tests.conformance.parts import BESIDE, add, ball, ground, painted, put, wall, world
from tests.conformance.scene import scene


def _pattern(kind, source="Generated", output="Color", inputs=(), **settings):
    """The ground painted by a procedural texture in some coordinates."""

    def colour(tree):
        vector = add(tree, "ShaderNodeTexCoord").outputs[source]
        node = add(tree, kind, {"Vector": vector, **dict(inputs)}, **settings)
        return node.outputs[output]

    return painted("ground", colour)


@scene(quick=True)
def noise_in_generated_coordinates(on):
    ground(_pattern("ShaderNodeTexNoise", inputs={"Scale": 3.0}) if on else None)
    world()


@scene()
def noise_in_object_coordinates(on):
    scale = {"Scale": 1.3}
    ground(
        _pattern("ShaderNodeTexNoise", "Object" if on else "UV", inputs=scale), rotation=(0, 0, 1)
    )
    world()


@scene(since=(5, 0))
def voronoi_by_the_uv_map(on):
    ground(_pattern("ShaderNodeTexVoronoi", "UV" if on else "Object", inputs={"Scale": 2.3}))
    world()


@scene(targets=("ball",))
def wave_along_the_normal(on):
    ball("ball", _pattern("ShaderNodeTexWave", "Normal" if on else "Generated", 0,
                          {"Scale": 0.4, "Distortion": 2.0}))  # fmt: skip
    world()


@scene(quick=True)
def bricks(on):
    ground(_pattern("ShaderNodeTexBrick", "UV", inputs={"Scale": 2.3}) if on else None)
    world()


@scene()
def checker(on):
    ground(_pattern("ShaderNodeTexChecker", "UV", inputs={"Scale": 4.7}) if on else None)
    world()


@scene(quick=True)
def magic(on):
    ground(_pattern("ShaderNodeTexMagic", "Object", inputs={"Scale": 2.0}) if on else None)
    world()


@scene()
def gradient_in_the_space_of_another_object(on):
    other = put("other", None, location=(-0.7, 0.4, 0), rotation=(0, 0, 0.7), scale=(2, 2, 2))

    def colour(tree):
        vector = add(tree, "ShaderNodeTexCoord", object=other if on else None).outputs["Object"]
        return add(tree, "ShaderNodeTexGradient", {"Vector": vector}).outputs[0]

    ground(painted("ground", colour))
    world()


@scene()
def white_noise_of_the_position(on):
    def colour(tree):
        position = add(tree, "ShaderNodeNewGeometry").outputs["Position"]
        cell = add(tree, "ShaderNodeVectorMath", {0: position, 1: (0.9, 0.9, 9)}, operation="SNAP")
        noise = add(tree, "ShaderNodeTexWhiteNoise", {"Vector": cell.outputs[0]})
        return noise.outputs["Color" if on else "Value"]

    ground(painted("ground", colour), location=(0.013, 0.017, 0.1))
    world()


@scene(quick=True)
def coordinates_of_the_texture_space(on):
    item = ground(_pattern("ShaderNodeTexGradient"))
    if on:
        item.data.use_auto_texspace = False
        item.data.texspace_location, item.data.texspace_size = (1, 0, 0), (2.5, 2.5, 2.5)
    world()


@scene(says=("material", "seen from straight on"), targets=("ground", "wall"))
def wireframe_in_pixels(on):
    def lines(tree):
        node = add(tree, "ShaderNodeWireframe", {"Size": 2.0 if on else 0.1}, use_pixel_size=on)
        return node.outputs[0]

    ground()
    world()
    wall(painted("wall", lines), **BESIDE)
