"""Rays that go on through what lets light pass.

Along a ray the shares that surfaces let pass are multiplied. What has a share for an answer gets
that product (`transmitted`: lamps). What is yes or no, a bit of the visibility or the one place
where a ray ends, is decided by a threshold of the ray's own: the ray ends at the first surface
behind which the product is not above it. So a cut-out is exact, of the rays through a pane the
right share passes, two panes are no more alike than two numbers that are multiplied, and the ray
towards a texel and the one that gathers along it agree.

The threshold follows from the ray alone, never from what is met: back-ends that differ in the last
digit of a hit decide alike, and a bake that goes on decides as before. Over the directions of a
cube map it runs through a sequence of low discrepancy (Roberts 2018: the plastic number), so that
any patch of the sky is dimmed by the right share; each start of rays shifts it by a hash, so that
a small sun behind a pane is right in the mean over points.
"""

import numpy as np

from prt_core.sphere import CubeMap

# Surfaces that a ray goes through; what is behind so many is taken as blocked, and said.
MOST_LAYERS = 64
# Of the plastic number, for columns and rows; of the golden ratio, for faces.
_COLUMN, _ROW, _FACE = 0.7548776662466927, 0.5698402909980532, 0.6180339887498949


class PassingCaster:
    """A `RayCaster` in which some triangles let some light pass.

    Parameters
    ----------
    opaque, others : RayCaster
        Over the triangles that let nothing pass, and over all others; hits are numbered alike.
    opacity : callable((m,) int, (m, 2) float, (m, 3) float) -> (m,) float
        Share of the light that does not go straight through, at hits on the others of rays along
        directions.
    behind : callable((m,) int, (m, 2) float, (m, 3) float) -> (m, 3), (m, 3) float64
        Where hits of rays along directions lie, and where a ray starts that goes on.
    resolution : int
        Of the cube map whose directions are traced.

    Attributes
    ----------
    too_deep : int
        Rays that met more than `MOST_LAYERS` surfaces that let light pass.
    """

    def __init__(self, opaque, others, opacity, behind, resolution=32):
        self._opaque, self._others = opaque, others
        self._opacity, self._behind = opacity, behind
        self._cube_map = CubeMap(resolution)
        self.too_deep = 0
        self.name = others.name if opaque.name == "empty" else opaque.name
        self.batch = min(opaque.batch, others.batch)
        self.threads = min(opaque.threads, others.threads)

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        blocked = self._opaque.occluded(origins, directions, distances)
        free = np.flatnonzero(~blocked)
        walk = self._walk(origins, directions, free, distances, decide=True)
        blocked[free[walk.share == 0]] = True
        return blocked

    def transmitted(self, origins, directions, distances=None):
        """The share of light that comes through.

        Parameters
        ----------
        origins, directions, distances
            As `RayCaster.occluded` takes them.

        Returns
        -------
        (m,) float32
        """
        share = (~self._opaque.occluded(origins, directions, distances)).astype(np.float32)
        free = np.flatnonzero(share)
        share[free] = self._walk(origins, directions, free, distances, decide=False).share
        return share

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        hits = self._opaque.intersect(origins, directions)
        every = np.arange(len(hits.triangle))
        walk = self._walk(origins, directions, every, hits.distance, decide=True, place=True)
        ended = np.flatnonzero(walk.share == 0)
        hits.triangle[ended] = walk.triangle[ended]
        hits.barycentric[ended] = walk.barycentric[ended]
        hits.distance[ended] = walk.distance[ended]
        return hits

    def close(self):
        """See `RayCaster`."""
        self._opaque.close()
        self._others.close()

    def _walk(self, origins, directions, rays, distances, decide, place=False):
        """What some rays meet of the surfaces that let light pass, layer by layer."""
        origins, directions = np.asarray(origins)[rays], np.asarray(directions)[rays]
        limit = None if distances is None else np.asarray(distances)[rays]
        walk = _Walk(len(rays), place)
        left, starts, travelled = np.arange(len(rays)), origins, 0.0
        for layer in range(MOST_LAYERS):
            if not len(left):
                break
            hits = self._others.intersect(starts, directions[left])
            met = hits.triangle >= 0
            if limit is not None:
                met &= travelled + hits.distance < limit[left]
            met = np.flatnonzero(met)
            triangle, barycentric = hits.triangle[met], hits.barycentric[met]
            left = left[met]
            share = walk.share[left] * (1 - self._opacity(triangle, barycentric, directions[left]))
            if decide:
                partial = np.flatnonzero((share > 0) & (share < 1))
                rays_of = origins[left[partial]], directions[left[partial]]
                share[partial[share[partial] <= self._thresholds(*rays_of)]] = 0
            if layer == MOST_LAYERS - 1:
                # What would go on still ends at the last surface that it is followed to.
                self.too_deep += int(np.count_nonzero(share))
                share[:] = 0
            walk.share[left] = share
            ends, on = np.flatnonzero(share == 0), np.flatnonzero(share)
            if place:
                distance = (travelled + hits.distance)[met[ends]]
                walk.end(left[ends], triangle[ends], barycentric[ends], distance)
            left = left[on]
            middle, starts = self._behind(triangle[on], barycentric[on], directions[left])
            if limit is not None or place:
                travelled = np.linalg.norm(middle - origins[left], axis=1)
            starts = starts.astype(origins.dtype)
        return walk

    def _thresholds(self, origins, directions):
        """(m,) float64 in 0..1 of each ray (see above)."""
        n = self._cube_map.resolution
        texel = self._cube_map.texel_along(*np.moveaxis(directions, -1, 0))
        row, column = np.divmod(texel, n)
        face, row = np.divmod(row, n)
        return (column * _COLUMN + row * _ROW + face * _FACE + _hash(origins)) % 1


class _Walk:
    """The share of light that gets along rays, and where those ended that got to nothing."""

    def __init__(self, n_rays, place):
        self.share = np.ones(n_rays)
        if place:
            self.triangle = np.full(n_rays, -1, np.int32)
            self.barycentric = np.zeros((n_rays, 2), np.float32)
            self.distance = np.full(n_rays, np.inf, np.float32)

    def end(self, rays, triangle, barycentric, distance):
        """Rays that end at places."""
        self.triangle[rays], self.barycentric[rays] = triangle, barycentric
        self.distance[rays] = distance


def transmitted(caster, origins, directions, distances=None):
    """(m,) float32: the share of light that comes through, by any caster (see `RayCaster`)."""
    if hasattr(caster, "transmitted"):
        return caster.transmitted(origins, directions, distances)
    return (~caster.occluded(origins, directions, distances)).astype(np.float32)


def _hash(origins):
    """(m,) float64 in 0..1, of the bits of places in float32 (Jenkins' mixing, lookup3)."""
    words = np.ascontiguousarray(origins, np.float32).view(np.uint32).reshape(-1, 3)
    a, b, c = (words[:, k] + np.uint32(0xDEADBEEF) for k in range(3))
    for turns in ((14, 11, 25), (16, 4, 14), (24, 14, 24)):
        for turn in turns:
            c = (c ^ b) - (b << np.uint32(turn) | b >> np.uint32(32 - turn))
            a, b, c = b, c, a
    return c / 2.0**32
