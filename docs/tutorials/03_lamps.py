"""
Lamps, mixed afterwards
=======================

Light adds up. So each lamp of a scene can be relit by itself, with all of its bounces, and then
dimmed and coloured without another ray: a mixing desk for light.
"""

# %%
# A room with four kinds of lamp; a red and a green wall bleed onto what stands in it.
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import prt_core
from prt_core.evaluate import to_display
from prt_core.evaluate.view import CameraRays

BLEND_SCENES = Path(prt_core.__file__).parents[1] / "blend_scenes"
prt_core.bake(BLEND_SCENES / "03_coloured_walls.blend", "walls.prt", resolution=8)
bake = prt_core.load("walls.prt")
print(", ".join(f"{lamp.name} ({lamp.kind})" for lamp in bake.lamps))

# %%
# What each lamp sends to every point, direct and by way of the walls.
fields = [prt_core.relight_points(bake, None, lamps=[lamp], lamp_samples=4) for lamp in bake.lamps]

# %%
# Three moods of the same fields.
moods = {
    "as built": np.ones((len(fields), 3)),
    "only the first two": np.array([[1, 1, 1], [1, 1, 1]] + [[0, 0, 0]] * (len(fields) - 2)),
    "blue night, one warm lamp": np.array([[2, 1, 0.4]] + [[0.05, 0.1, 0.4]] * (len(fields) - 1)),
}
caster = bake.make_caster(rays="camera")
rays = CameraRays(bake.scene, caster, bake.camera, 400, 260)
figure, frames = plt.subplots(1, 3, figsize=(12, 3), layout="constrained")
for frame, (mood, gains) in zip(frames, moods.items(), strict=True):
    mixed = sum(field * gain for field, gain in zip(fields, gains, strict=True))
    picture = rays.picture(mixed.astype(np.float32))
    frame.imshow(to_display(picture, bake.view_transform))
    frame.set(title=mood, xticks=[], yticks=[])
caster.close()
plt.show()
