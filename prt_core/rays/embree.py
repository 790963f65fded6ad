"""Intel's Embree through embreex (optional extra), on all cores: it releases the GIL."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

from prt_core.rays.caster import Hits, as_limits, as_rays, barycentric_of, register_caster
from prt_core.runtime.cores import n_cores

_SLICE = 1 << 17


class EmbreeCaster:
    """Rays cut into slices that a pool of threads casts; up to one slice stays in the caller's.

    Several threads may call it at once.

    Parameters
    ----------
    vertices : (n_vertices, 3) float
    triangles : (n_triangles, 3) int
    """

    name = "embree"
    batch = _SLICE

    def __init__(self, vertices, triangles):
        self._vertices = np.ascontiguousarray(vertices, np.float32)
        self._triangles = np.ascontiguousarray(triangles, np.int32)
        self._scene = rtcore_scene.EmbreeScene()
        TriangleMesh(self._scene, self._vertices, self._triangles)
        # Embree builds its BVH on the first query; two threads must not both do it.
        self._scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32), query="OCCLUDED")
        self.threads = n_cores()
        self._pool = ThreadPoolExecutor(self.threads)

    def _slices(self, cast, n_rays, dtype):
        if n_rays <= _SLICE:
            return cast(slice(0, n_rays))
        result = np.empty(n_rays, dtype)

        def one(first):
            result[first : first + _SLICE] = cast(slice(first, first + _SLICE))

        list(self._pool.map(one, range(0, n_rays, _SLICE)))
        return result

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        origins, directions = as_rays(origins, directions)
        limits = as_limits(distances, len(origins))

        def cast(part):
            limit = None if limits is None else np.ascontiguousarray(limits[part])
            return self._scene.run(origins[part], directions[part], limit, query="OCCLUDED") == 0

        return self._slices(cast, len(origins), bool)

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        origins, directions = as_rays(origins, directions)

        def cast(part):
            return self._scene.run(origins[part], directions[part], query="INTERSECT")

        triangle = self._slices(cast, len(origins), np.int32)
        barycentric, distance = barycentric_of(
            self._vertices, self._triangles, origins, directions, triangle
        )
        return Hits(triangle, barycentric, distance)

    def close(self):
        """See `RayCaster`."""
        self._pool.shutdown()
        self._scene = None


register_caster("embree", EmbreeCaster)
