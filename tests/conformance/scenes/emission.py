"""Surfaces that shine."""

import math

import bpy
import numpy as np

from tests.conformance.parts import (
    BESIDE,
    GREY,
    add,
    ball,
    box,
    emission,
    geometry_nodes,
    grid,
    ground,
    image,
    move,
    painted,
    plain,
    plate,
    principled,
    put,
    shaded,
    sheet,
    wall,
    world,
)
from tests.conformance.scene import scene

DOWN = {"rotation": (math.pi, 0, 0), "location": (0, 0, 1.5)}


@scene(quick=True)
def panel(on):
    ground()
    world(0.1)
    sheet("panel", emission("panel", (1, 1, 1), 4.0 * on), 1, **DOWN)


@scene(quick=True, samples=4096)
def panel_in_the_dark(on):
    ground()
    world(0.0)
    sheet("panel", emission("panel", (1, 0.5, 0.2), 4.0 if on else 2.0), 1, **DOWN)
    box(size=0.5, location=(0, 0, 0.3))


@scene(samples=4096, quick=True)
def tube(on):
    ground()
    world(0.1)
    data = bpy.data.curves.new("tube", "CURVE")
    data.dimensions, data.bevel_depth = "3D", 0.03
    spline = data.splines.new("POLY")
    spline.points.add(1)
    spline.points[0].co, spline.points[1].co = (-1.5, 0, 0.8, 1), (1.5, 0, 0.8, 1)
    data.materials.append(emission("tube", (0.2, 1, 0.4), 30.0 * on))
    put("tube", data)


@scene()
def dome(on):
    ground()
    world(0.1)
    ball("dome", emission("dome", (0.3, 0.5, 1.0) if on else (0, 0, 0), 1.0), 20)


@scene()
def dome_with_a_gradient(on):
    def surface(tree):
        position = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
        height = add(tree, "ShaderNodeSeparateXYZ", {0: position}).outputs["X"]
        return add(tree, "ShaderNodeEmission", {"Strength": height if on else 0.0}).outputs[0]

    ground()
    world(0.1)
    box(location=(0, 0, 0.55))
    ball("dome", shaded("dome", surface), 20)


@scene()
def screen_that_shows_an_image(on):
    pixels = np.zeros((4, 4, 3))
    pixels[:, :2, 0], pixels[:, 2:, 2] = 0.9, 0.9

    def surface(tree):
        colour = add(tree, "ShaderNodeTexImage", image=image("show", pixels)).outputs[0]
        lit = {"Color": colour if on else (0.4, 0.0, 0.4, 1), "Strength": 5.0}
        return add(tree, "ShaderNodeEmission", lit).outputs[0]

    ground()
    world(0.1)
    sheet("screen", shaded("screen", surface), 2, 8, **DOWN)


@scene()
def panel_that_shines_on_both_sides(on):
    ground()
    world(0.1)
    glow = emission("panel", (1, 1, 1), 3.0 * on)
    sheet("panel", glow, 1.5, location=(0, 0, 1), rotation=(0, math.pi / 2, 0))


@scene(quick=True)
def panel_that_shines_on_its_front_only(on):
    def surface(tree):
        back = add(tree, "ShaderNodeNewGeometry").outputs["Backfacing"]
        glow = add(tree, "ShaderNodeEmission", {"Strength": 3.0}).outputs[0]
        dark = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (0, 0, 0, 1)}).outputs[0]
        factor = back if on else 0.0
        return add(tree, "ShaderNodeMixShader", {0: factor, 1: glow, 2: dark}).outputs[0]

    ground()
    world(0.1)
    where = {"location": (0, 0, 0.8), "rotation": (0, math.pi / 2, 0)}
    sheet("panel", shaded("panel", surface), 1.5, **where)


@scene()
def letters_that_shine(on):
    ground()
    world(0.1)
    data = bpy.data.curves.new("letters", "FONT")
    data.body, data.size, data.align_x = "HI", 1.5, "CENTER"
    data.materials.append(emission("letters", (1, 0.2, 0.6), 6.0 * on))
    put("letters", data, location=(0, 0, 0.8))


@scene(quick=True)
def emission_of_principled(on):
    glow = {"Base Color": (*GREY, 1), "Emission Color": (1, 0.6, 0.2, 1)}
    glow["Emission Strength"] = 3.0 * on
    ground()
    world(0.1)
    sheet("panel", principled("panel", glow), 1, **DOWN)


@scene()
def sum_of_emission_and_diffuse(on):
    def surface(tree):
        glow = {"Color": (0.1, 0.3, 1, 1), "Strength": 2.0 * on}
        glow = add(tree, "ShaderNodeEmission", glow).outputs[0]
        paint = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*GREY, 1)}).outputs[0]
        return add(tree, "ShaderNodeAddShader", {0: glow, 1: paint}).outputs[0]

    ground()
    world(0.5)
    plate(material=shaded("plate", surface), location=(0, 0, 0.8))


@scene(samples=8192)
def small_and_bright(on):
    ground()
    world(0.1)
    ball("bulb", emission("bulb", (1, 0.8, 0.5), 100.0 * on), 0.08, 6, 12, location=(0.3, 0.2, 1))


@scene(samples=4096, quick=True)
def shadow_of_a_bulb(on):
    ground()
    world(0.1)
    ball("bulb", emission("bulb", (1, 0.8, 0.5), 60.0), 0.1, 6, 12, location=(0, 0, 1.6))
    if on:
        plate(size=0.7, location=(0, 0, 0.6))


@scene(samples=4096)
def two_panels_of_two_colours(on):
    ground()
    world(0.1)
    for x, colour in ((-1.2, (1, 0.1, 0.1)), (1.2, (0.1, 0.1, 1))):
        name = f"panel {x}"
        glow = emission(name, colour if on else (0.5, 0.1, 0.5), 5.0)
        sheet(name, glow, 0.8, **(DOWN | {"location": (x, 0, 1)}))


@scene()
def panel_that_lights_a_wall_that_lights_the_ground(on):
    ground()
    world(0.05)
    wall(plain("wall", (0.9, 0.1, 0.1)), scale=(1, 1, 1), location=(-2, 0, 2))
    turn = {"rotation": (0, -math.pi / 2, 0), "location": (-0.5, 0, 2.2)}
    sheet("panel", emission("panel", (1, 1, 1), 8.0 * on), 1, **turn)
    plate("shade", plain("shade", (0, 0, 0)), 1.4, location=(0, 0, 1.5))


@scene(quick=True)
def one_face_of_many_that_shines(on):
    ground()
    world(0.1)
    item = sheet("ceiling", plain("ceiling", GREY), 3, 3, **DOWN)
    item.data.materials.append(emission("lamp panel", (1, 1, 1), 5.0))
    item.data.polygons[4].material_index = int(on)


@scene()
def emission_of_a_blackbody(on):
    def surface(tree):
        colour = add(tree, "ShaderNodeBlackbody", {0: 2000.0}).outputs[0]
        lit = {"Color": colour if on else (1, 1, 1, 1), "Strength": 4.0}
        return add(tree, "ShaderNodeEmission", lit).outputs[0]

    ground()
    world(0.1)
    sheet("panel", shaded("panel", surface), 1, **DOWN)


@scene()
def instanced_bulbs(on):
    ground()
    world(0.1)
    bulbs = bpy.data.collections.new("bulbs")
    glow = emission("bulb", (1, 1, 1), 6.0)
    move(ball("bulb", glow, 0.3, 6, 12, location=(0, 0, 0)), bulbs)
    for x in (-1, 1) if on else ():
        item = put("light", None, location=(x, 0, 0.9))
        item.instance_type, item.instance_collection = "COLLECTION", bulbs


@scene(quick=True)
def bulbs_by_geometry_nodes(on):
    ground()
    world(0.1)
    glow = emission("bulbs", (0.4, 1, 0.6), 5.0 * on)

    def bulbs(tree, geometry):
        cube = add(tree, "GeometryNodeMeshCube", {"Size": (0.3, 0.3, 0.3)}).outputs[0]
        paint = {"Geometry": cube, "Material": glow}
        cube = add(tree, "GeometryNodeSetMaterial", paint).outputs[0]
        put_on = {"Points": geometry, "Instance": cube}
        return add(tree, "GeometryNodeInstanceOnPoints", put_on).outputs[0]

    geometry_nodes(grid("seeds", 1, 2, location=(0, 0, 0.9)), bulbs)


@scene()
def panel_that_diffuse_rays_do_not_see(on):
    ground()
    world(0.3)
    item = sheet("panel", emission("panel", (1, 1, 1), 4.0), 1, **DOWN)
    item.visible_diffuse = not on


@scene(samples=4096)
def emission_that_is_not_sampled(on):
    # How Cycles finds it must not matter.
    ground()
    world(0.1)
    glow = emission("panel", (1, 1, 1), 4.0 * on)
    if hasattr(glow.cycles, "emission_sampling"):
        glow.cycles.emission_sampling = "NONE"
    sheet("panel", glow, 2.5, **DOWN)


@scene()
def emission_that_only_the_camera_sees(on):
    def surface(tree):
        seen = add(tree, "ShaderNodeLightPath").outputs["Is Camera Ray"]
        return add(tree, "ShaderNodeEmission", {"Strength": seen if on else 3.0}).outputs[0]

    ground()
    world(0.3)
    sheet("panel", shaded("panel", surface), 1, **DOWN)


@scene()
def lava_of_noise(on):
    def surface(tree):
        noise = add(tree, "ShaderNodeTexNoise", {"Scale": 3.0}).outputs[0]
        ramp = add(tree, "ShaderNodeValToRGB", {0: noise})
        ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.45, 0.6
        ramp.color_ramp.elements[1].color = (1, 0.3, 0.05, 1)
        return add(
            tree, "ShaderNodeEmission", {"Color": ramp.outputs[0], "Strength": 8.0 * on}
        ).outputs[0]

    ground(painted("ground", lambda tree: add(tree, "ShaderNodeRGB").outputs[0]))
    world(0.3)
    sheet("lava", shaded("lava", surface), 2.5, 12, **DOWN)


@scene(says=("material", "below zero"))
def wall_that_takes_light_away(on):
    def surface(tree):
        paper = add(tree, "ShaderNodeBsdfDiffuse", {"Color": (*GREY, 1)}).outputs[0]
        dark = add(tree, "ShaderNodeEmission", {"Strength": -0.5 * on}).outputs[0]
        return add(tree, "ShaderNodeAddShader", {0: paper, 1: dark}).outputs[0]

    ground()
    world()
    wall(shaded("wall", surface), **BESIDE)
