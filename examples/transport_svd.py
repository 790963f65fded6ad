"""How many singular values the transport of each object has, direct and with all bounces.

python examples/transport_svd.py BAKE.prt [POINTS]
"""

import sys

import numpy as np

import prt_core

bake = prt_core.load(sys.argv[1])
most = int(sys.argv[2]) if len(sys.argv) > 2 else 500
transport, points = bake.transport, bake.scene.points
# Columns weighed so that equal coordinates are equal power of the light.
weights = 1 / np.sqrt(bake.cube_map.solid_angles)

print(f"singular values that hold 99 % and 99.9 % of the energy, of {most} rows an object")
for index, item in enumerate(bake.scene.objects):
    mine = np.flatnonzero((points.object_index == index) & points.visible)
    mine = mine[np.linspace(0, len(mine) - 1, min(most, len(mine))).astype(int)]
    for name, indirect in (("direct", False), ("all bounces", True)):
        rows = transport.rows(mine, indirect=indirect)[:, :, 1] * weights
        energy = np.cumsum(np.linalg.svd(rows, compute_uv=False) ** 2)
        ranks = [int(np.searchsorted(energy, share * energy[-1])) + 1 for share in (0.99, 0.999)]
        print(f"{item.name:12} {name:12} {ranks[0]:5} {ranks[1]:5}")
