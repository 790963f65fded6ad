"""
A sky that turns, and a sun that is sharp
=========================================

One bake under a light that moves: each frame is a product of the transport with the light, not a
render. Where an image has a hard sun, shadow rays at relighting make its shadows sharp again.
"""

# %%
# `BLEND_SCENES` are the project's own; any file of yours will do.
from pathlib import Path

import bpy
import matplotlib.pyplot as plt

import prt_core
from prt_core.evaluate import to_display
from prt_core.evaluate.view import CameraRays

BLEND_SCENES = Path(prt_core.__file__).parents[1] / "blend_scenes"
prt_core.bake(BLEND_SCENES / "02_model_on_ground_small.blend", "small.prt", resolution=16)
bake = prt_core.load("small.prt")

# %%
# A `Relighter` keeps what two lights have in common; `CameraRays` what each pixel sees.
city = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world", "city.exr")
relighter = prt_core.Relighter(bake)
caster = bake.make_caster(rays="camera")
rays = CameraRays(bake.scene, caster, bake.camera, 320, 200)
figure, rows = plt.subplots(2, 4, figsize=(12, 4), layout="constrained")
for frames, sharp in zip(rows, (False, True), strict=True):
    for frame, turn in zip(frames, (0, 40, 80, 120), strict=True):
        light = prt_core.Lighting(city, rotation=turn, sharp_sun=sharp, exposure=-1)
        picture = rays.picture(relighter.radiance(light))
        frame.imshow(to_display(picture, bake.view_transform))
        kind = "sharp sun" if sharp else "texels"
        frame.set(title=f"{kind}, {turn}°", xticks=[], yticks=[])
caster.close()
relighter.close()
plt.show()
