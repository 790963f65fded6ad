"""A fine golden ball on a floor with two lamps; and its light field, where Blender can capture one.

The story builds the scene in its window, the test in another Blender: Debian's has no cameras that
are shaders.
"""

import bmesh
import bpy
from rooms import mesh_of, put

SEGMENTS, RINGS, ANGLES = 300, 200, (8, 6)
FIELD = "prt/gold.slf"


def build():
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    put("floor", mesh_of("floor", 2.5, 8), (0, 0, -1))
    ball, sphere = bpy.data.meshes.new("ball"), bmesh.new()
    bmesh.ops.create_uvsphere(sphere, u_segments=SEGMENTS, v_segments=RINGS, radius=1.0)
    for face in sphere.faces:
        face.smooth = True
    sphere.to_mesh(ball)
    sphere.free()
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


def capture():
    """Write the light field of the ball, a field a lamp."""
    from prt_core.api import light_field

    bpy.ops.wm.read_factory_settings(use_empty=True)
    build()
    light_field(None, FIELD, objects=["ball"], angles=ANGLES, samples=2, lamps=True)
