"""Every ray against every triangle, in float64: slow, readable, the oracle of the other casters."""

import numpy as np

from prt_core.rays.caster import MISS, Hits, as_limits, as_rays, register_caster


class BruteForceCaster:
    """Möller & Trumbore's test (1997) for all pairs; a hit on an edge or corner counts.

    Parameters
    ----------
    vertices : (n_vertices, 3) float
    triangles : (n_triangles, 3) int
    """

    name = "brute"
    batch = 1 << 14
    threads = 1

    def __init__(self, vertices, triangles):
        corner = np.asarray(vertices, np.float64)[np.asarray(triangles)]
        self._a = corner[:, 0]
        self._edge1 = corner[:, 1] - corner[:, 0]
        self._edge2 = corner[:, 2] - corner[:, 0]

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        distance = self.intersect(origins, directions).distance
        limits = as_limits(distances, len(distance))
        return distance < (np.inf if limits is None else limits)

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        origins, directions = as_rays(origins, directions)
        n_rays, step = len(origins), max(1, 2_000_000 // max(1, len(self._a)))
        triangle = np.full(n_rays, MISS, np.int32)
        barycentric = np.zeros((n_rays, 2), np.float32)
        distance = np.full(n_rays, np.inf, np.float32)
        for first in range(0, n_rays, step):
            part = slice(first, first + step)
            origin = origins[part, None].astype(np.float64)
            direction = directions[part, None].astype(np.float64)
            p = np.cross(direction, self._edge2)
            determinant = (self._edge1 * p).sum(-1)
            inverse = 1 / np.where(determinant == 0, np.nan, determinant)
            start = origin - self._a
            u = (start * p).sum(-1) * inverse
            q = np.cross(start, self._edge1)
            v = (direction * q).sum(-1) * inverse
            t = (self._edge2 * q).sum(-1) * inverse
            inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
            t = np.where(inside, t, np.inf)
            best = t.argmin(axis=1)
            rows = np.arange(len(best))
            hit = np.isfinite(t[rows, best])
            triangle[part] = np.where(hit, best, MISS)
            barycentric[part, 0] = np.where(hit, u[rows, best], 0)
            barycentric[part, 1] = np.where(hit, v[rows, best], 0)
            distance[part] = t[rows, best]
        return Hits(triangle, barycentric, distance)

    def close(self):
        """See `RayCaster`."""
        self._a = self._edge1 = self._edge2 = None


register_caster("brute", BruteForceCaster)
