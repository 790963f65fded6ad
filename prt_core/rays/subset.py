"""Rays that meet some of the triangles only."""

import numpy as np

from prt_core.rays.caster import MISS, Hits, as_rays

_BATCH = 1 << 17


class SubsetCaster:
    """A `RayCaster` over some triangles, whose hits bear the numbers that these have in the whole.

    Parameters
    ----------
    caster : RayCaster
        Over the triangles alone.
    triangles : (n,) int
        Their numbers in the whole.
    corners : (n, 3, 2) float, optional
        Where they are pieces of these: weights of the second and third corner of the whole, at
        each of their own.
    """

    def __init__(self, caster, triangles, corners=None):
        self._caster, self._corners = caster, corners
        # The last one is read by misses.
        self._numbers = np.append(triangles, MISS).astype(np.int32)
        self.name, self.batch, self.threads = caster.name, caster.batch, caster.threads

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        return self._caster.occluded(origins, directions, distances)

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        hits = self._caster.intersect(origins, directions)
        barycentric = hits.barycentric
        if self._corners is not None:
            met = np.flatnonzero(hits.triangle >= 0)
            first, second, third = np.moveaxis(self._corners[hits.triangle[met]], 1, 0)
            one, two = barycentric[met].astype(np.float64).T[:, :, None]
            whole = first + one * (second - first) + two * (third - first)
            barycentric[met] = np.clip(whole, 0, 1)
        return Hits(self._numbers[hits.triangle], barycentric, hits.distance)

    def close(self):
        """See `RayCaster`."""
        self._caster.close()


class EmptyCaster:
    """A `RayCaster` over no triangle at all: every ray misses."""

    name = "empty"
    batch = _BATCH
    threads = 1

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        return np.zeros(len(as_rays(origins, directions)[0]), bool)

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        n_rays = len(as_rays(origins, directions)[0])
        nothing = np.zeros((n_rays, 2), np.float32)
        return Hits(np.full(n_rays, MISS, np.int32), nothing, np.full(n_rays, np.inf, np.float32))

    def close(self):
        """Holds nothing."""
