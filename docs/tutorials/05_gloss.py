"""
Gloss: the view moves too
=========================

What a metal sends depends on who looks. A bake with ``gloss=True`` keeps what its points reflect,
and is then relit for a view.
"""

# %%
# A brass Suzanne on a lacquered floor.
from pathlib import Path

import bpy
import matplotlib.pyplot as plt
from mathutils import Vector

import prt_core
from prt_core.evaluate import to_display
from prt_core.evaluate.view import CameraRays


def principled(name, colour, **inputs):
    """A material of one colour."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    node = material.node_tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (*colour, 1)
    for key, value in inputs.items():
        node.inputs[key].default_value = value
    return material


bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_monkey_add(location=(0, 0, 1))
bpy.context.object.data.materials.append(
    principled("brass", (0.9, 0.65, 0.25), Metallic=1, Roughness=0.35)
)
bpy.context.object.modifiers.new("smooth", "SUBSURF").render_levels = 1
bpy.ops.object.shade_smooth()
bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, size=6)
bpy.context.object.data.materials.append(principled("lacquer", (0.25, 0.05, 0.05), Roughness=0.4))
prt_core.bake(None, "brass.prt", resolution=16, gloss=True, restart=True)

# %%
# Two cameras, one light. Pictures are shaded by pixels: each has a lobe of its own.
sky = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world", "courtyard.exr")
bake = prt_core.load("brass.prt")
relighter, caster = prt_core.Relighter(bake), bake.make_caster(rays="camera")
light = prt_core.Lighting(sky, rotation=60, exposure=-1)
figure, frames = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
for frame, place in zip(frames, ((2.5, -5.5, 2.6), (-4.5, -4.0, 1.2)), strict=True):
    towards = (Vector((0, 0, 0.9)) - Vector(place)).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    towards.translation = place
    rays = CameraRays(bake.scene, caster, prt_core.Camera(towards, 0.33), 320, 208)
    picture = relighter.picture(rays, light)
    frame.imshow(to_display(picture, bake.view_transform))
    frame.set(title=f"from {place}", xticks=[], yticks=[])
caster.close()
relighter.close()
plt.show()
