"""
A first bake under three skies
==============================

Build a scene, bake it once, and light it with skies that the bake knew nothing of.
"""

# %%
# A scene is any .blend file, or what is open in Blender. Here one is made: Suzanne on a floor.
# A mesh holds light at its vertices, so the floor has enough of them to hold a shadow.
from pathlib import Path

import bpy
import matplotlib.pyplot as plt

import prt_core
from prt_core.evaluate import render_view, to_display

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_monkey_add(location=(0, 0, 1))
bpy.context.object.modifiers.new("smooth", "SUBSURF").render_levels = 1
bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40, size=7)
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
bpy.context.collection.objects.link(camera)
camera.location, camera.rotation_euler = (2.2, -6.2, 3.4), (1.18, 0, 0.34)
bpy.context.scene.camera = camera

# %%
# The bake: once for all lights. It chooses the rays that the scene needs, and says how far what
# it did not trace can be from what it did.
report = prt_core.bake(None, "monkey.prt", resolution=16, restart=True)
print(f"{report['points']:,} points, {report['rays']:,} rays, error {report['error']:.1%}")

# %%
# Now any light will do: an image, `.hdr` or `.exr`, turned as one likes. Blender brings some.
skies = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world")
bake = prt_core.load("monkey.prt")
caster = bake.make_caster(rays="camera")
figure, frames = plt.subplots(1, 3, figsize=(12, 3), layout="constrained")
for frame, (name, stops) in zip(
    frames, {"courtyard": 0, "city": -2, "sunset": 0}.items(), strict=True
):
    radiance = prt_core.relight_points(bake, skies / f"{name}.exr", rotation=60, exposure=stops)
    picture = render_view(bake, radiance, caster, width=400, height=260)
    frame.imshow(to_display(picture, bake.view_transform))
    frame.set(title=f"{name}, {stops:+} stops", xticks=[], yticks=[])
caster.close()
plt.show()
