"""
A light field: any material, from any side
==========================================

Gold and its caustics, glass, skin: what Cycles can render, it can also capture, at all points in
all directions. Compressed, such a field is looked at from any side, and its lamps are dimmed and
coloured afterwards. (Blender 4.5 and later.)
"""

# %%
# A gold ring on a plane under two lamps, and a black sky.
import math

import bpy
import matplotlib.pyplot as plt
import numpy as np
from mathutils import Vector

import prt_core
from prt_core.bake.light_field_view import field_picture, field_toward
from prt_core.evaluate import to_display

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.engine = "CYCLES"
bpy.ops.mesh.primitive_torus_add(
    major_segments=32, minor_segments=12, major_radius=0.8, minor_radius=0.2, location=(0, 0, 0.2)
)
bpy.ops.object.shade_smooth()
gold = bpy.data.materials.new("gold")
gold.use_nodes = True
inputs = gold.node_tree.nodes["Principled BSDF"].inputs
inputs["Base Color"].default_value = (1, 0.77, 0.34, 1)
inputs["Metallic"].default_value, inputs["Roughness"].default_value = 1, 0.3
bpy.context.object.data.materials.append(gold)
bpy.ops.mesh.primitive_grid_add(x_subdivisions=24, y_subdivisions=24, size=4)
for name, angle, watts in (("left", 2.4, 150), ("right", 0.3, 150)):
    lamp = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
    bpy.context.collection.objects.link(lamp)
    lamp.location = 2.5 * math.cos(angle), 2.5 * math.sin(angle), 2
    lamp.data.energy, lamp.data.shadow_soft_size = watts, 0.3

# %%
# One render takes what leaves each vertex in 12 x 6 directions, a field for each lamp and one for
# the world, which is black here. A real one has 32 x 16 directions and hundreds of samples.
prt_core.light_field(
    None, "ring.slf", angles=(12, 6), samples=8, lamps=True, denoise=True, restart=True
)
field = prt_core.load_light_field("ring.slf")
print(f"{len(field):,} points, lights: {', '.join(field.lights)}")

# %%
# From two sides, and with other lamps than it was captured under.
caster = field.scene.make_caster(rays="camera")
figure, frames = plt.subplots(1, 3, figsize=(12, 3.2), layout="constrained")
coloured = {"left": np.array([3, 0.5, 0.2]), "right": np.array([0.2, 0.6, 3])}
looks = (
    ("as lit", (0.5, -4.5, 2.5), None),
    ("from the side", (-4, 1, 1.5), None),
    ("red and blue", (0.5, -4.5, 2.5), coloured),
)
for frame, (title, place, strengths) in zip(frames, looks, strict=True):
    towards = (-Vector(place)).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    towards.translation = place
    camera = prt_core.Camera(towards, tangent=0.33)
    radiance, _ = field_toward(field, prt_core.View.of_camera(camera), strengths)
    picture = field_picture(field, radiance, camera, caster, 400, 260)
    frame.imshow(to_display(picture, field.view_transform))
    frame.set(title=title, xticks=[], yticks=[])
caster.close()
plt.show()
