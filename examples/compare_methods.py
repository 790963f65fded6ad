"""Compressors side by side on one bake: size, time of a light and error, under a light of yours.

python examples/compare_methods.py BAKE.prt LIGHT.exr
"""

import sys
import time

import prt_core
from prt_core.compress import PCA, ClusteredPCA, HaarLighting, Harmonics, TransportRows
from prt_core.evaluate import colour_error

bake = prt_core.load(sys.argv[1])
transport = bake.transport
light = prt_core.environment_light(bake, sys.argv[2], rotation=70)
truth = transport.radiance(light)
rows = prt_core.run(TransportRows(transport).prepare_steps())

# Not more components than half of the points: the example runs on small scenes as well.
few = min(16, transport.n_points // 2)
for model in (
    PCA(few),
    ClusteredPCA(n_clusters=max(2, transport.n_points // 500), n_components=few // 2),
    HaarLighting(n_terms=256, step=1e-3),
    Harmonics(order=5),
):
    model.fit(rows)
    start = time.perf_counter()
    radiance = transport.exit_radiance(model.product(light)).toward()
    spent = 1e3 * (time.perf_counter() - start)
    error = colour_error(radiance, truth)["l2"]
    print(f"{type(model).__name__:14} {model.nbytes / 1e6:7.2f} MB {spent:7.1f} ms {error:7.2%}")
