"""Both sides of every face."""

import math

import numpy as np

from tests.conformance.parts import (
    BESIDE,
    BLUE,
    GREY,
    RED,
    add,
    ball,
    box,
    emission,
    grid,
    ground,
    lamp,
    mesh_object,
    painted,
    plain,
    sheet,
    wall,
    world,
)
from tests.conformance.scene import scene

AWAY = {"rotation": (0, -math.pi / 2, 0)}


@scene(quick=True)
def back_of_a_wall(on):
    ground()
    world()
    wall(plain("wall", RED if on else (0, 0, 0)), **BESIDE, **AWAY)


@scene(quick=True)
def underside_of_a_sheet(on):
    ground()
    world()
    sheet("sheet", plain("sheet", RED if on else (0, 0, 0)))


@scene(light="lamps", quick=True)
def back_under_a_lamp(on):
    ground()
    wall(plain("wall", RED if on else (0, 0, 0)), **BESIDE, **AWAY)
    lamp("lamp", "POINT", (-1, 0, 1.5), 100)


@scene(samples=4096)
def room_whose_faces_look_outwards(on):
    ground()
    world()
    sides = [(-2, 0, 0, -1), (2, 0, 0, 1), (0, -2, 1, 0), (0, 2, -1, 0)]
    for number, (x, y, turn_x, turn_y) in enumerate(sides):
        turn = (turn_x * math.pi / 2, turn_y * math.pi / 2, 0)
        paint = plain(f"wall {number}", (0.8, 0.8, 0.8) if on else (0, 0, 0))
        grid(f"wall {number}", 8, 4, paint, location=(x, y, 2), rotation=turn)


@scene(light="lamps", samples=4096, targets=("box",))
def inside_of_a_sphere_whose_faces_look_outwards(on):
    ball("shell", plain("shell", (0.5, 0.5, 0.8) if on else (0, 0, 0)), 2)
    box(location=(0, 0, -1))
    lamp("lamp", "POINT", (0, 0, 0.6), 100)


@scene(quick=True)
def two_colours_of_two_sides(on):
    def colour(tree):
        back = add(tree, "ShaderNodeNewGeometry").outputs["Backfacing"]
        node = add(tree, "ShaderNodeMix", data_type="RGBA")
        tree.links.new(back, node.inputs[0])
        node.inputs[6].default_value = (*BLUE, 1)
        node.inputs[7].default_value = (*(RED if on else BLUE), 1)
        return node.outputs[2]

    ground()
    world()
    sheet("sheet", painted("sheet", colour))


@scene()
def backface_culling_of_the_viewport(on):
    # A setting of EEVEE: Cycles keeps the back.
    material = plain("sheet", RED if on else (0, 0, 0))
    material.use_backface_culling = True
    ground()
    world()
    sheet("sheet", material)


@scene(targets=("floor",))
def floor_that_looks_down(on):
    # What is baked is the front, below; light comes from there as well.
    world()
    grid("floor", 8, 4, plain("floor", GREY), rotation=(math.pi if on else 0, 0, 0))
    box(location=(0, 0, 0.6))


@scene()
def faces_of_mixed_directions(on):
    ground()
    world()
    item = wall(plain("wall", RED if on else (0, 0, 0)), **BESIDE)
    for polygon in list(item.data.polygons)[::2]:
        polygon.flip()
    item.data.update()


@scene(quick=True)
def two_sheets_of_one_place(on):
    ground()
    world()
    sheet("up", plain("up", RED if on else (0, 0, 0)))
    sheet("down", plain("down", RED if on else (0, 0, 0)), rotation=(math.pi, 0, 0))


@scene()
def box_without_a_bottom(on):
    ground()
    world()
    item = box(size=1.6, location=(0, 0, 1), material=plain("box", RED if on else (0, 0, 0)))
    corners = np.array([v.co for v in item.data.vertices])
    faces = [tuple(p.vertices) for p in item.data.polygons][1:]
    other = mesh_object("open box", corners, faces, item.data.materials[0])
    other.location, item.hide_render = (0, 0, 1), True


@scene()
def leaves_that_stand(on):
    ground()
    world()
    green = plain("leaves", (0.05, 0.8, 0.1) if on else (0, 0, 0))
    for number in range(7):
        turn = (math.pi / 2, 0, number)
        place = (0.4 * number - 1.2, 0.3 * (-1) ** number, 0.4)
        grid(f"leaf {number}", 2, 0.7, green, location=place, rotation=turn)


@scene()
def back_that_shines(on):
    ground()
    world(0.2)
    sheet("sheet", emission("sheet", (1, 0.6, 0.3), 2.0 if on else 0.0), location=(0, 0, 1.5))
