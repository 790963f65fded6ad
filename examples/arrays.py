"""Functions on arrays, without Blender: light inside a hollow cube with an open lid.

python examples/arrays.py
"""

import numpy as np

from prt_core.rays import BruteForceCaster
from prt_core.scene import Mesh, Scene
from prt_core.sphere import CubeMap
from prt_core.transport import (
    all_bounces,
    gather_hits,
    gather_operator,
    received_light,
    visibility_bits,
)

corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
# Five sides, counter-clockwise seen from inside; +z is open.
quads = np.array([[0, 4, 6, 2], [0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3]])
corner_vertex = quads.ravel()
a, b, c = np.moveaxis(corners[quads[:, :3]], 1, 0)
normals = np.repeat(np.cross(b - a, c - a), 4, axis=0)
first = np.arange(0, 20, 4)[:, None]
triangles = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
albedo, sizes = np.full((20, 3), 0.7), np.full(5, 4)
box = Mesh("box", corners, corner_vertex, normals, triangles, albedo, face_sizes=sizes)

scene = Scene.from_meshes([box], max_hidden=400)
caster = BruteForceCaster(scene.vertices, scene.triangles)
cube_map = CubeMap(8)
every = slice(0, len(scene.points))
bits = visibility_bits(scene, cube_map, caster, every)
hits = gather_hits(scene, caster, every, seed=0, round_index=0).hits
gather = gather_operator(hits, len(scene.points))
sky = np.ones((cube_map.n_directions, 3), np.float32)
received = received_light(bits, scene.points.normals, cube_map, sky)
radiance, n_bounces = all_bounces(gather, scene.points.albedo, received)
print(f"{len(scene.points)} points, {n_bounces} bounces")
print(f"direct {0.7 * received.mean():.3f}, with bounces {radiance.mean():.3f}")
