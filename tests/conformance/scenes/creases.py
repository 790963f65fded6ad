"""Coarse meshes: bent quads, sharp creases, few faces that are shaded smooth."""

import bpy
import numpy as np

from tests.conformance.parts import add, ground, lamp, mesh_object, plain, world
from tests.conformance.scene import scene

BRIGHT = (0.8, 0.8, 0.8)


def heights_on_a_grid(name, heights, size):
    """A square of quads whose vertices are at these heights (rows, columns)."""
    rows, columns = heights.shape
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, columns), np.linspace(-0.5, 0.5, rows))
    vertices = np.column_stack([size * x.ravel(), size * y.ravel(), heights.ravel()])
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.column_stack([first, first + 1, first + columns + 1, first + columns])
    return mesh_object(name, vertices, faces, plain(name, BRIGHT))


def sky_from_one_side():
    """Bright towards +x, dark towards -x."""

    def surface(tree):
        way = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
        way = add(tree, "ShaderNodeSeparateXYZ", {0: way})
        side = {0: way.outputs[0], "From Min": -1, "To Max": 2}
        strength = add(tree, "ShaderNodeMapRange", side).outputs[0]
        return add(tree, "ShaderNodeBackground", {"Strength": strength}).outputs[0]

    world(surface=surface)


def random_heights(rows, columns, seed):
    return np.random.default_rng(seed).uniform(0, 1, (rows, columns))


@scene(targets=("sheet",), quick=True)
def crumpled_sheet(on):
    sky_from_one_side()
    heights_on_a_grid("sheet", (0.3 if on else 0) * random_heights(21, 21, 4), 4)


@scene(targets=("folds",), quick=True)
def folds_with_bent_faces(on):
    sky_from_one_side()
    heights = np.tile([0.0, 0.6], 9)[:17] * np.ones((6, 1))
    heights_on_a_grid("folds", (heights + 0.1 * random_heights(6, 17, 5)) * on, 6)


@scene(targets=("ground", "head"), bound=0.02)
def head_of_500_flat_faces(on):
    sky_from_one_side()
    _head(smooth=not on)


@scene(light="lamps", targets=("ground", "head"), bound=0.05)
def head_of_500_smooth_faces(on):
    # Cycles takes what is below a corner's face from the light of a plain sky, not from lamps'.
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0.7, 0.3, 0))
    lamp("other sun", "SUN", (0, 0, 3), 3, rotation=(-0.4, -0.9, 0))
    _head(smooth=on)


def _head(smooth):
    ground()
    bpy.ops.mesh.primitive_monkey_add(size=2, location=(0, 0, 0.9), rotation=(-0.4, 0, 0))
    head = bpy.context.object
    head.name = head.data.name = "head"
    head.data.polygons.foreach_set("use_smooth", [smooth] * len(head.data.polygons))
    head.data.materials.append(plain("head", BRIGHT))
