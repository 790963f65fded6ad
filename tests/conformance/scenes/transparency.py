"""What lets light through: alpha, Transparent, translucent leaves, glass."""

import math

import numpy as np

from tests.conformance.parts import (
    BLUE,
    GREEN,
    GREY,
    RED,
    add,
    box,
    ground,
    image,
    lamp,
    plain,
    principled,
    shaded,
    shader,
    sheet,
    world,
)
from tests.conformance.scene import scene

CLEAR = "ShaderNodeBsdfTransparent"


def _cut(factor):
    """Green where `factor(tree)` is 1, transparent where it is 0."""

    def surface(tree):
        clear = add(tree, CLEAR).outputs[0]
        leaf = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*GREEN, 1)}).outputs[0]
        return add(tree, "ShaderNodeMixShader", {0: factor(tree), 1: clear, 2: leaf}).outputs[0]

    return shaded("pane", surface)


def _leaf(alpha, **settings):
    """A Principled BSDF whose alpha is that of an image."""
    pixels = np.zeros((8, 8, 4))
    pixels[..., :3], pixels[..., 3] = GREEN, alpha

    def surface(tree):
        texture = add(tree, "ShaderNodeTexImage", image=image("leaf", pixels), **settings).outputs
        inputs = {"Base Color": texture[0], "Alpha": texture[1], "Specular IOR Level": 0}
        return add(tree, "ShaderNodeBsdfPrincipled", inputs).outputs[0]

    return shaded("pane", surface)


def _cards():
    """(8, 8) alpha: a leaf that fills half of its card."""
    alpha = np.zeros((8, 8))
    alpha[1:7, 2:6] = 1
    return alpha


@scene(quick=True)
def leaf_card(on):
    ground()
    world()
    sheet("pane", _leaf(_cards() if on else 1, interpolation="Closest"))


@scene(light="lamps", quick=True)
def leaf_card_under_a_sun(on):
    ground()
    sheet("pane", _leaf(_cards() if on else 1, interpolation="Closest"))
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0.2, 0.3, 0))


@scene(quick=True)
def leaf_card_that_is_all_cut_away(on):
    ground()
    world()
    sheet("pane", _leaf(0 if on else 1))


@scene()
def leaf_card_of_half_alpha(on):
    ground()
    world()
    sheet("pane", _leaf(0.5 if on else 1))


@scene()
def hedge_of_leaf_cards(on):
    ground()
    world()
    material, random = (
        _leaf(_cards() if on else 1, interpolation="Closest"),
        np.random.default_rng(7),
    )
    for number in range(40):
        place = random.uniform((-1, -1, 0.2), (1, 1, 1.2))
        turn = random.uniform(0, 2 * math.pi, 3)
        sheet(f"leaf {number}", material, 0.5, 1, location=place, rotation=turn)


@scene(quick=True)
def alpha_of_principled(on):
    ground()
    world()
    glaze = {"Base Color": (*BLUE, 1), "Alpha": 0.4 if on else 1}
    sheet("pane", principled("pane", glaze))


@scene()
def alpha_with_the_method_clip(on):
    # A setting of EEVEE: Cycles blends.
    ground()
    world()
    material = principled("pane", {"Base Color": (*BLUE, 1), "Alpha": 0.4 if on else 1})
    if hasattr(material, "blend_method"):
        material.blend_method = "CLIP"
        material.alpha_threshold = 0.5
    sheet("pane", material)


@scene()
def transparent_pane(on):
    ground()
    world()
    sheet("pane", shader("pane", CLEAR) if on else plain("pane", GREY), 3)


@scene(light="lamps", quick=True)
def transparent_pane_under_a_lamp(on):
    ground()
    sheet("pane", shader("pane", CLEAR) if on else plain("pane", GREY), 1.5, location=(0, 0, 1))
    lamp("lamp", "POINT", (0, 0, 2), 100)


@scene(says=("pane", "coloured transparency"))
def coloured_transparent_pane(on):
    ground()
    world()
    colour = (0.9, 0.4, 0.1, 1) if on else (1, 1, 1, 1)
    sheet("pane", shader("pane", CLEAR, {"Color": colour}), 3)


@scene(light="lamps", says=("pane", "coloured transparency"))
def coloured_pane_under_a_sun(on):
    ground()
    colour = (0.9, 0.4, 0.1, 1) if on else (1, 1, 1, 1)
    sheet("pane", shader("pane", CLEAR, {"Color": colour}), 2)
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0.2, 0.3, 0))


@scene(says=("pane", "coloured transparency"))
def stacked_panes(on):
    ground()
    world()
    tint = shader("pane", CLEAR, {"Color": (0.8, 0.6, 0.9, 1)})
    for number in range(5 if on else 1):
        sheet(f"pane {number}", tint, 3, location=(0, 0, 0.3 + 0.1 * number))


@scene(quick=True)
def mix_with_transparent(on):
    ground()
    world()
    sheet("pane", _cut(lambda tree: 0.3 if on else 1.0))


@scene()
def transparent_by_a_checker(on):
    def factor(tree):
        uv = add(tree, "ShaderNodeTexCoord").outputs["UV"]
        checker = {"Vector": uv, "Scale": 4.0, "Color1": (1, 1, 1, 1), "Color2": (0, 0, 0, 1)}
        return add(tree, "ShaderNodeTexChecker", checker).outputs[0] if on else 1.0

    ground()
    world()
    sheet("pane", _cut(factor))


@scene(light="lamps")
def transparent_by_a_checker_under_a_sun(on):
    def factor(tree):
        uv = add(tree, "ShaderNodeTexCoord").outputs["UV"]
        checker = {"Vector": uv, "Scale": 4.0, "Color1": (1, 1, 1, 1), "Color2": (0, 0, 0, 1)}
        return add(tree, "ShaderNodeTexChecker", checker).outputs[0] if on else 1.0

    ground()
    sheet("pane", _cut(factor))
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0.2, 0.3, 0))


@scene()
def transparent_front_and_solid_back(on):
    def back(tree):
        return add(tree, "ShaderNodeNewGeometry").outputs["Backfacing"] if on else 1.0

    ground()
    world()
    sheet("pane", _cut(back), rotation=(math.pi, 0, 0))


@scene(says=("pane", "layer weight"), quick=True)
def transparent_where_it_is_seen_head_on(on):
    def facing(tree):
        return add(tree, "ShaderNodeLayerWeight").outputs["Facing"] if on else 1.0

    ground()
    world()
    sheet("pane", _cut(facing))


@scene(light="lamps")
def transparent_to_shadow_rays(on):
    # The old trick of architects: what is seen is solid, what asks for light is let through.
    def solid(tree):
        shadow = add(tree, "ShaderNodeLightPath").outputs["Is Shadow Ray"]
        return add(tree, "ShaderNodeMath", {0: 1.0, 1: shadow}, operation="SUBTRACT").outputs[0]

    ground()
    sheet("pane", _cut(solid if on else lambda tree: 1.0))
    lamp("lamp", "POINT", (0, 0, 2), 100)


@scene()
def transparent_to_diffuse_rays(on):
    def solid(tree):
        bounce = add(tree, "ShaderNodeLightPath").outputs["Is Diffuse Ray"]
        return add(tree, "ShaderNodeMath", {0: 1.0, 1: bounce}, operation="SUBTRACT").outputs[0]

    ground()
    world()
    sheet("pane", _cut(solid if on else lambda tree: 1.0))


@scene(quick=True)
def translucent_leaf(on):
    ground()
    world()
    leaf = shader("pane", "ShaderNodeBsdfTranslucent", {"Color": (*GREEN, 1)})
    sheet("pane", leaf if on else plain("pane", GREEN))


@scene()
def half_translucent_leaf(on):
    def surface(tree):
        back = add(tree, "ShaderNodeBsdfTranslucent", {"Color": (*GREEN, 1)}).outputs[0]
        front = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*GREEN, 1)}).outputs[0]
        return add(tree, "ShaderNodeMixShader", {0: 0.5 * on, 1: front, 2: back}).outputs[0]

    ground()
    world()
    sheet("pane", shaded("pane", surface), 3)


@scene(light="lamps", quick=True)
def translucent_leaf_under_a_sun(on):
    ground()
    leaf = shader("pane", "ShaderNodeBsdfTranslucent", {"Color": (*GREEN, 1)})
    sheet("pane", leaf if on else plain("pane", GREEN))
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0.2, 0.3, 0))


@scene(says=("pane", "glass"))
def glass_pane(on):
    ground()
    world()
    glass = shader("pane", "ShaderNodeBsdfGlass", {"Color": (1, 1, 1, 1)})
    sheet("pane", glass if on else plain("pane", (0, 0, 0)), 3)


@scene(says=("box", "glass"), samples=4096)
def glass_block(on):
    ground()
    world()
    glass = shader("box", "ShaderNodeBsdfGlass", {"Color": (0.9, 0.95, 1, 1)})
    box(material=glass if on else plain("box", (0, 0, 0)))


@scene(says=("pane", "glass"))
def refraction_shader(on):
    ground()
    world()
    glass = shader("pane", "ShaderNodeBsdfRefraction", {"Color": (0.5, 0.9, 0.6, 1)})
    sheet("pane", glass if on else plain("pane", (0, 0, 0)), 3)


@scene(says=("pane", "glass"), quick=True)
def glass_of_principled(on):
    ground()
    world()
    glass = {"Base Color": (0.6, 0.8, 0.9, 1), "Transmission Weight": 1.0, "Roughness": 0.0}
    glass["Specular IOR Level"] = 0.5
    sheet("pane", principled("pane", glass) if on else plain("pane", (0, 0, 0)), 3)


@scene(says=("pane", "glass"))
def architects_glass(on):
    # Glass that is transparent to shadow and diffuse rays.
    def surface(tree):
        path = add(tree, "ShaderNodeLightPath").outputs
        rays = (path["Is Shadow Ray"], path["Is Diffuse Ray"])
        either = add(tree, "ShaderNodeMath", dict(enumerate(rays)), operation="MAXIMUM").outputs[0]
        glass, clear = add(tree, "ShaderNodeBsdfGlass").outputs[0], add(tree, CLEAR).outputs[0]
        return add(tree, "ShaderNodeMixShader", {0: either, 1: glass, 2: clear}).outputs[0]

    ground()
    world()
    sheet("pane", shaded("pane", surface) if on else plain("pane", (0, 0, 0)), 3)


@scene(says=("pane", "specular"))
def thin_glass_of_transparent_and_gloss(on):
    def surface(tree):
        clear = add(tree, CLEAR, {"Color": (0.8, 0.9, 0.8, 1)}).outputs[0]
        gloss = add(tree, "ShaderNodeBsdfAnisotropic", {"Roughness": 0.0}).outputs[0]
        return add(tree, "ShaderNodeMixShader", {0: 0.1, 1: clear, 2: gloss}).outputs[0]

    ground()
    world()
    sheet("pane", shaded("pane", surface) if on else plain("pane", RED), 3)


@scene()
def transparent_by_addition(on):
    def surface(tree):
        clear = add(tree, CLEAR, {"Color": (0.5, 0.5, 0.5, 1)}).outputs[0]
        solid = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (0.4, 0.1, 0.1, 1)}).outputs[0]
        return add(tree, "ShaderNodeAddShader", {0: clear, 1: solid}).outputs[0]

    ground()
    world()
    sheet("pane", shaded("pane", surface) if on else plain("pane", (0.4, 0.1, 0.1)))


@scene()
def sheet_without_a_surface_shader(on):
    ground()
    world()
    material = plain("pane", RED)
    if on:
        material.node_tree.links.clear()
    sheet("pane", material)
