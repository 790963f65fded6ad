"""Shaders other than Principled, mixed and alone, and the directions that they take."""

import numpy as np

from tests.conformance.parts import (
    BESIDE,
    BLUE,
    GREEN,
    GREY,
    RED,
    add,
    ball,
    ground,
    image,
    lamp,
    painted,
    plain,
    shaded,
    shader,
    wall,
    world,
)
from tests.conformance.scene import scene


@scene(light="lamps", says=("ground", "roughness"), since=(4, 3))
def rough_diffuse(on):
    ground(shader("ground", "ShaderNodeBsdfDiffuse", {"Color": (*GREY, 1), "Roughness": float(on)}))
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0, 1.3, 0))


@scene(says=("wall", "specular"))
def glossy_shader(on):
    gloss = {"Color": (*(RED if on else (0, 0, 0)), 1), "Roughness": 0.6}
    ground()
    wall(shader("wall", "ShaderNodeBsdfAnisotropic", gloss), **BESIDE)
    world()


@scene(light="lamps", says=("ground", "toon"))
def toon_shader(on):
    toon = {"Color": (*GREY, 1), "Size": 0.6}
    kind = "ShaderNodeBsdfToon" if on else "ShaderNodeBsdfDiffuse"
    ground(shader("ground", kind, toon if on else {"Color": (*GREY, 1)}))
    lamp("lamp", "POINT", (0, 0, 1), 50)


@scene(says=("wall", "sheen"), quick=True)
def sheen_shader(on):
    kind = "ShaderNodeBsdfSheen" if on else "ShaderNodeBsdfDiffuse"
    ground()
    wall(shader("wall", kind, {"Color": (*RED, 1)}), **BESIDE)
    world()


@scene(says=("ground", "subsurface"), samples=8192)
def subsurface_shader(on):
    kind = "ShaderNodeSubsurfaceScattering" if on else "ShaderNodeBsdfDiffuse"
    ground(shader("ground", kind, {"Color": (*GREY, 1)}))
    world()


@scene(quick=True)
def mix_of_two_diffuse(on):
    def surface(tree):
        red = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*RED, 1)}).outputs[0]
        blue = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*BLUE, 1)}).outputs[0]
        return add(tree, "ShaderNodeMixShader", {0: 0.75 * on, 1: red, 2: blue}).outputs[0]

    ground(shaded("ground", surface))
    world()


@scene()
def sum_of_two_diffuse(on):
    def surface(tree):
        red = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (0.5, 0.1, 0.1, 1)}).outputs[0]
        blue = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (0.1, 0.1, 0.4, 1)}).outputs[0]
        return add(tree, "ShaderNodeAddShader", {0: red, 1: blue} if on else {0: red}).outputs[0]

    ground(shaded("ground", surface))
    world()


@scene()
def mix_by_a_texture(on):
    def surface(tree):
        red = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*RED, 1)}).outputs[0]
        blue = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*BLUE, 1)}).outputs[0]
        uv = add(tree, "ShaderNodeTexCoord").outputs["UV"]
        factor = add(tree, "ShaderNodeTexGradient", {0: uv}).outputs[0] if on else 0.5
        return add(tree, "ShaderNodeMixShader", {0: factor, 1: red, 2: blue}).outputs[0]

    ground(shaded("ground", surface))
    world()


@scene(quick=True)
def output_for_cycles(on):
    material = plain("ground", GREY)
    tree = material.node_tree
    if on:
        other = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*GREEN, 1)}).outputs[0]
        add(tree, "ShaderNodeOutputMaterial", {"Surface": other}, target="CYCLES")
        tree.nodes[1].target = "EEVEE"
    ground(material)
    world()


@scene()
def two_outputs_of_which_one_is_active(on):
    material = plain("ground", GREY)
    tree = material.node_tree
    other = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*GREEN, 1)}).outputs[0]
    output = add(tree, "ShaderNodeOutputMaterial", {"Surface": other})
    output.is_active_output = on
    ground(material)
    world()


@scene()
def output_without_a_surface(on):
    material = plain("wall", RED)
    if on:
        material.node_tree.links.clear()
    ground()
    wall(material, **BESIDE)
    world()


@scene(light="lamps", quick=True)
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

    ball("ball", painted("ball", colour), location=(0.3, 0.2, 0.1))
    world()


@scene()
def colour_by_the_side_that_is_seen(on):
    def colour(tree):
        back = add(tree, "ShaderNodeNewGeometry").outputs["Backfacing"]
        node = add(tree, "ShaderNodeMix", data_type="RGBA")
        tree.links.new(back, node.inputs[0])
        node.inputs[6].default_value = (*BLUE, 1)
        node.inputs[7].default_value = (*(RED if on else BLUE), 1)
        return node.outputs[2]

    ground()
    world()
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

    ground()
    wall(painted("wall", colour), **BESIDE)
    world()
