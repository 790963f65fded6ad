"""A fine golden ball on a floor with two lamps; and its light field, where Blender can capture one.

The story builds the scene in its window, the test in another Blender: Debian's has no cameras that
are shaders.
"""

import bpy
import numpy as np
from rooms import mesh_of, put

SEGMENTS, RINGS, ANGLES = 300, 200, (8, 6)
FIELD = "prt/gold.slf"


def build():
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    put("floor", mesh_of("floor", 2.5, 8), (0, 0, -1))
    ball = sphere("ball")
    put("ball", ball).select_set(True)
    gold = bpy.data.materials.new("gold")
    if gold.node_tree is None:
        gold.use_nodes = True
    shader = next(n for n in gold.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = 1, 0.7, 0.3, 1
    shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value = 1, 0.45
    ball.materials.append(gold)
    for name, place, colour in (
        ("warm", (-3, -3, 3), (1, 0.6, 0.3)), ("cold", (3, -2, 4), (0.4, 0.6, 1)),
    ):  # fmt: skip
        lamp = bpy.data.lights.new(name, "POINT")
        lamp.energy, lamp.color, lamp.shadow_soft_size = 400, colour, 0.5
        put(name, lamp, place)


def sphere(name):
    """A mesh whose corners are in the same order in every version of Blender."""
    mesh, over = bpy.data.meshes.new(name), np.pi / RINGS
    up = np.repeat(np.linspace(over, np.pi - over, RINGS - 1), SEGMENTS)
    around = np.tile(np.arange(SEGMENTS) * 2 * np.pi / SEGMENTS, RINGS - 1)
    ring = np.stack([np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up)], axis=1)
    n, faces = SEGMENTS, []
    top, bottom = len(ring), len(ring) + 1
    for k in range(n):
        beside = (k + 1) % n
        faces += [(top, k, beside), (bottom, top - n + beside, top - n + k)]
        faces += [(r * n + k, r * n + n + k, r * n + n + beside, r * n + beside)
                  for r in range(RINGS - 2)]  # fmt: skip
    mesh.from_pydata([*ring.tolist(), (0, 0, 1), (0, 0, -1)], [], faces)
    mesh.shade_smooth()
    return mesh


def capture():
    """Write the light field of the ball, a field a lamp."""
    from prt_core.api import light_field

    bpy.ops.wm.read_factory_settings(use_empty=True)
    build()
    light_field(None, FIELD, objects=["ball"], angles=ANGLES, samples=2, lamps=True)
