"""
What one bit a direction knows
==============================

A bake keeps, for each point and each direction, whether the sky is seen. Sums of these bits are
ambient occlusion, bent normals, and the shadow of any one direction, without another ray.
"""

# %%
# Thin leaves and sheets over a floor: many small shadows.
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import prt_core
from prt_core.evaluate import to_srgb
from prt_core.evaluate.view import CameraRays
from prt_core.transport import received_light

BLEND_SCENES = Path(prt_core.__file__).parents[1] / "blend_scenes"
prt_core.bake(BLEND_SCENES / "02_model_on_ground_small.blend", "small.prt", resolution=16)
bake = prt_core.load("small.prt")
bits, normals, cube = bake.transport.bits, bake.scene.points.normals, bake.cube_map

# %%
# An even sky of radiance 1, without bounces, is ambient occlusion.
even = np.ones((cube.n_directions, 3), np.float32)
openness = received_light(bits, normals, cube, even)

# %%
# Three skies that are x, y and z of the direction: together the mean direction that is seen, the
# bent normal. Skies may be negative: all of this is linear.
bent = received_light(bits, normals, cube, cube.directions.astype(np.float32))
bent /= np.maximum(np.linalg.norm(bent, axis=1, keepdims=True), 1e-6)

# %%
# And one bit of all points: the shadow of a sun that stands in one texel.
d = int(cube.texel_of(np.array([[0.6, -0.5, 0.8]]))[0])
lit = (bits[:, d // 8] >> d % 8 & 1).astype(np.float32)

# %%
# As pictures.
caster = bake.make_caster(rays="camera")
rays = CameraRays(bake.scene, caster, bake.camera, 400, 260)
shown = {
    "ambient occlusion": openness,
    "bent normals": (0.5 * bent + 0.5).astype(np.float32),
    "one direction": np.repeat(lit[:, None], 3, axis=1),
}
figure, frames = plt.subplots(1, 3, figsize=(12, 3), layout="constrained")
for frame, (name, values) in zip(frames, shown.items(), strict=True):
    frame.imshow(to_srgb(rays.picture(values)))
    frame.set(title=name, xticks=[], yticks=[])
caster.close()
plt.show()
