"""
How many dimensions has light?
==============================

Diffuse surfaces blur what falls on them. Nine harmonics are nearly enough where nothing is in the
way; shadows want more. How much more, the singular values of the transport say.
"""

# %%
# A small bake, and its rows, scaled so that equal coordinates are equal power of the light.
from pathlib import Path

import bpy
import matplotlib.pyplot as plt
import numpy as np

import prt_core
from prt_core.compress import Harmonics, TransportRows
from prt_core.evaluate import to_srgb
from prt_core.evaluate.view import CameraRays

BLEND_SCENES = Path(prt_core.__file__).parents[1] / "blend_scenes"
prt_core.bake(BLEND_SCENES / "02_model_on_ground_small.blend", "small.prt", resolution=16)
bake = prt_core.load("small.prt")
transport, points = bake.transport, bake.scene.points
seen = np.flatnonzero(points.visible)
chosen = seen[np.linspace(0, len(seen) - 1, 400).astype(int)]
spectra = {}
for name, indirect in (("direct", False), ("all bounces", True)):
    rows = transport.rows(chosen, indirect=indirect)[:, :, 1] / np.sqrt(bake.cube_map.solid_angles)
    values = np.linalg.svd(rows, compute_uv=False)
    spectra[name] = values / values[0]

# %%
# The same sun of an image, by nine harmonics a point and exactly. Nine cannot hold its shadow.
sky = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world", "city.exr")
light = prt_core.environment_light(bake, sky, rotation=70)
rows = prt_core.run(TransportRows(transport).prepare_steps())
nine = transport.exit_radiance(Harmonics(order=3).fit(rows).product(light)).toward()
caster = bake.make_caster(rays="camera")
figure, frames = plt.subplot_mosaic(
    [["values", "nine", "exact"]], figsize=(13, 3.4), layout="constrained"
)
for name, values in spectra.items():
    frames["values"].semilogy(values, label=name)
frames["values"].set(xlabel="singular value", title="of 400 rows", ylim=(1e-4, 1.5))
frames["values"].legend()
rays = CameraRays(bake.scene, caster, bake.camera, 400, 260)
for name, radiance in (("nine", nine), ("exact", transport.radiance(light))):
    frames[name].imshow(to_srgb(rays.picture(radiance), -1))
    frames[name].set(title={"nine": "nine harmonics", "exact": "exact"}[name], xticks=[], yticks=[])
caster.close()
plt.show()
