"""
How small can transport be?
===========================

The rows of the transport matrix are much alike. Clustered PCA, PCA, wavelets and harmonics use
that in different ways; here they stand side by side: bytes against the error of relit colours.
"""

# %%
# The rows of one bake, and a light that no method was made for.
from pathlib import Path

import bpy
import matplotlib.pyplot as plt

import prt_core
from prt_core.compress import PCA, ClusteredPCA, HaarLighting, Harmonics, TransportRows
from prt_core.evaluate import colour_error

BLEND_SCENES = Path(prt_core.__file__).parents[1] / "blend_scenes"
prt_core.bake(BLEND_SCENES / "02_model_on_ground_small.blend", "small.prt", resolution=16)
bake = prt_core.load("small.prt")
city = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world", "city.exr")
light = prt_core.environment_light(bake, city, rotation=70)
truth = bake.transport.radiance(light)
rows = prt_core.run(TransportRows(bake.transport).prepare_steps())

# %%
# Each at four sizes. `prt compress` does this on a sample of the points and takes the best.
methods = {
    "PCA": [PCA(n) for n in (4, 8, 16, 32)],
    "clustered PCA": [ClusteredPCA(8, n) for n in (2, 4, 8, 16)],
    "Haar lighting": [HaarLighting(256, step=step) for step in (0.1, 0.03, 0.01, 0.003)],
    "harmonics": [Harmonics(order) for order in (2, 3, 4, 6)],
}
figure, frame = plt.subplots(figsize=(7, 4.5), layout="constrained")
for name, models in methods.items():
    sizes, errors = [], []
    for model in models:
        model.fit(rows)
        radiance = bake.transport.exit_radiance(model.product(light)).toward()
        sizes.append(model.nbytes / 1e6)
        errors.append(100 * colour_error(radiance, truth)["l2"])
    frame.loglog(sizes, errors, "o-", label=name)
frame.set(xlabel="MB", ylabel="error of relit colours, per cent", title="city, turned by 70°")
frame.grid(alpha=0.3, which="both")
frame.legend()
plt.show()
