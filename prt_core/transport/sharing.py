"""Which bake point a ray's end is handed to: only one that the place that was met can see.

A hit lies in a cell of its triangle's lattice, and is handed to one of the three bake points
around it with the probability of its barycentric weight. But a wall may stand on that cell, with a
corner behind it: then light of the other side would be let in. So a short ray asks whether the
place that was met sees the chosen point; if it does not, another of the three is chosen, in
proportion to their weights. Most cells are clear: their corners see each other (see
`transport.clear_cells`), and nobody asks. Where there are points inside of cells (see
`transport.details`) the nearest of them comes first, and where no corner is seen they are all that
is left.
"""

import numpy as np
from scipy.spatial import cKDTree

from prt_core.transport.clear_cells import clear_cells

MISS, DARK = -1, -2
# A detail serves places nearer to it than any corner, and than this share of the farthest one.
_NEAR = 0.2
# Details asked where no corner is seen.
_MOST = 8
# A detail lies in the plane of the place it serves, but for so much of its distance.
_FLAT = 0.02
# Short rays end this share of their length before the point.
_SHORT = 1 - 1e-4


class Places:
    """Where rays met the surface.

    Parameters
    ----------
    scene : Scene
    triangle : (m,) int
    barycentric : (m, 2) float
    directions : (m, 3) float32
        Of the rays.

    Attributes
    ----------
    back : (m,) bool
    normal : (m, 3) float32
        Of the side that was met.
    around, weights : (m, 3)
        The bake points around each place (see `Scene.hit_points`).
    position, start : (m, 3) float64
        And where a ray from there starts.
    """

    def __init__(self, scene, triangle, barycentric, directions):
        front = scene.triangle_normals.take(triangle, axis=0)
        self.triangle, self.barycentric = triangle, barycentric
        self.back = np.einsum("mx,mx->m", directions, front) > 0
        self.normal = np.where(self.back[:, None], -front, front)
        self.around, self.weights = scene.hit_points(triangle, barycentric, self.back)
        second, third = np.asarray(barycentric, np.float64).T
        corners = scene.triangles.take(triangle, axis=0)
        # One array a coordinate: rows of three take three times as long.
        a, b, c = (scene.vertices.take(corners[:, k], axis=0).T for k in range(3))
        position = a + second * (b - a) + third * (c - a)
        start = position + scene.triangle_lifts.take(triangle) * self.normal.T
        self.position, self.start = np.ascontiguousarray(position.T), np.ascontiguousarray(start.T)


class Sharing:
    """Hands hits of a scene to its bake points.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster, optional
        Then one look at all cells of triangles finds those in which no place has to be asked what
        it sees (see `transport.clear_cells`).

    Attributes
    ----------
    n_rays : int
        That this look took.
    """

    def __init__(self, scene, caster=None):
        self._scene, self._clear, self.n_rays = scene, None, 0
        self._near_details = _triangles_near(scene)
        if caster is not None:
            self._clear, self.n_rays = clear_cells(scene, caster)
            self._clear[self._near_details] = False
        points, details = scene.points, scene.details.point
        self._details = points.positions[details]
        # Sides that face otherwise are far away.
        self._tree = cKDTree(np.hstack([self._details, points.geometric_normals[details]]))

    def ends(self, caster, hits, directions, pick):
        """Where rays end.

        Parameters
        ----------
        caster : RayCaster
        hits : Hits
        directions : (m, 3) float32
        pick : (m,) float32
            Uniform random numbers: which of the points around a hit.

        Returns
        -------
        ends : (m,) int32
            Bake points; MISS where nothing was met, DARK where a side without light was, or a
            place that sees no bake point of its own.
        unlit : (m,) bool
            Whether a back was met that returns no light.
        hidden : (m,) bool
            Whether a place was met that sees no bake point of its own.
        short : (m,) uint8
            Rays that were cast from each place to see who may share it.
        """
        ends = np.full(len(directions), MISS, np.int32)
        unlit, hidden = np.zeros((2, len(directions)), bool)
        short = np.zeros(len(directions), np.uint8)
        hit = np.flatnonzero(hits.triangle >= 0)
        if self._clear is not None:
            hit = self._hand_clear(hit, hits, directions, pick, ends)
        places = Places(self._scene, hits.triangle[hit], hits.barycentric[hit], directions[hit])
        chosen, asked = self.choose(caster, places, pick[hit])
        ends[hit] = np.where(chosen >= 0, chosen, DARK)
        unlit[hit] = places.around[:, 0] < 0
        hidden[hit] = (chosen < 0) & (places.around[:, 0] >= 0)
        short[hit] = asked
        return ends, unlit, hidden, short

    def _hand_clear(self, hit, hits, directions, pick, ends):
        """Hand hits in clear cells to bake points, into `ends`; returns the others."""
        scene, triangle = self._scene, hits.triangle.take(hit)
        way = directions.take(hit, axis=0)
        back = np.einsum("mx,mx->m", way, scene.triangle_normals.take(triangle, axis=0)) > 0
        clear = self._clear[triangle, back.view(np.uint8)]
        mine = np.flatnonzero(clear)
        own = hit[mine]
        around, weights = scene.hit_points(triangle[mine], hits.barycentric[own], back[mine])
        # One of the three, by weights that sum to 1.
        first = weights[:, 0].astype(np.float64)
        corner = (pick[own] >= first).view(np.uint8) + (pick[own] >= first + weights[:, 1])
        ends[own] = around[np.arange(len(own)), corner]
        return hit[~clear]

    def choose(self, caster, places, pick):
        """Hand places to bake points.

        Parameters
        ----------
        caster : RayCaster
        places : Places
        pick : (m,) float32
            Uniform random numbers: which of the points around a place.

        Returns
        -------
        chosen : (m,) int32
            The bake point of each place, -1 where none is seen.
        short : (m,) uint8
            Rays that were cast from each.
        """
        handed = _Handed(len(places.triangle))
        left = np.flatnonzero(places.around[:, 0] >= 0)
        left = self._try_nearest_detail(caster, places, left, handed)
        left = self._try_corners(caster, places, left, handed, pick.astype(np.float64))
        self._try_details(caster, places, left, handed)
        return handed.chosen, handed.short

    def corner_distances(self, places):
        """(m, 3) float64: how far the corners of its cell are from each of the `places`."""
        corners = self._scene.points.positions[places.around]
        return np.linalg.norm(corners - places.position[:, None], axis=2)

    def _hand(self, caster, places, subset, points, handed):
        """Hand places to bake points where they see them: whether they do."""
        scene = self._scene
        starts = places.start[subset]
        ways = scene.ray_origins[points] - starts
        lengths = np.linalg.norm(ways, axis=1)
        # A ray that is not longer than what it starts above the surface is of the same place.
        seen = lengths <= 8 * scene.triangle_lifts[places.triangle[subset]]
        asked = np.flatnonzero(~seen)
        if len(asked):
            handed.short[subset[asked]] += 1
            directions = (ways[asked] / lengths[asked, None]).astype(np.float32)
            starts, limit = starts[asked], (lengths[asked] * _SHORT).astype(np.float32)
            if scene.ray_origins.dtype == np.float32:
                starts = starts.astype(np.float32)
            seen[asked] = ~caster.occluded(starts, directions, limit)
        handed.chosen[subset[seen]] = points[seen]
        return seen

    def _try_nearest_detail(self, caster, places, left, handed):
        """Those that have a detail right beside them; returns the others."""
        beside = left[self._near_details[places.triangle[left]]]
        if not len(beside):
            return left
        index, distance = self._nearest_details(places, beside, 1)
        away = np.linalg.norm(
            self._scene.points.positions[places.around[beside]] - places.position[beside, None],
            axis=2,
        )
        near = distance[:, 0] < np.minimum(away.min(axis=1), _NEAR * away.max(axis=1))
        beside, points = beside[near], self._scene.details.point[index[near, 0]]
        seen = self._hand(caster, places, beside, points, handed)
        return np.setdiff1d(left, beside[seen], assume_unique=True)

    def _try_corners(self, caster, places, left, handed, pick):
        """One of the corners that each place sees; returns those that see none."""
        weights, lost = places.weights.astype(np.float64), []
        for _ in range(3):
            total = weights[left].sum(axis=1)
            # A corner without weight is not around the place.
            reached = total > 1e-6
            lost.append(left[~reached])
            left, total = left[reached], total[reached, None]
            if not len(left):
                break
            shares = weights[left] / total
            ends = np.cumsum(shares, axis=1)
            corner = (pick[left, None] >= ends[:, :2]).sum(axis=1)
            row = np.arange(len(left))
            points = places.around[left, corner]
            seen = self._hand(caster, places, left, points, handed)
            # Within the share of a corner that is refused the number is uniform again.
            share = shares[row, corner]
            within = (pick[left] - ends[row, corner] + share) / np.maximum(share, 1e-12)
            pick[left] = np.clip(within, 0, 1 - 1e-12)
            weights[left, corner] = 0
            left = left[~seen]
        return np.sort(np.concatenate([*lost, left]))

    def _try_details(self, caster, places, left, handed):
        """The nearest detail that each place sees, however far."""
        left = left[self._near_details[places.triangle[left]]]
        if not len(left):
            return
        index, distance = self._nearest_details(places, left, _MOST)
        for which in range(index.shape[1]):
            reached = np.isfinite(distance[:, which])
            seen = np.zeros(len(left), bool)
            points = self._scene.details.point[index[reached, which]]
            seen[reached] = self._hand(caster, places, left[reached], points, handed)
            left, index, distance = left[~seen], index[~seen], distance[~seen]

    def _nearest_details(self, places, subset, count):
        """Indices and distances (n, count) of details in the same plane; infinite where not."""
        place, normal = places.position[subset], places.normal[subset]
        count = min(count, len(self._details))
        _, index = self._tree.query(np.hstack([place, normal]), k=count)
        index = index.reshape(len(subset), count)
        way = self._details[index] - place[:, None]
        distance = np.linalg.norm(way, axis=2)
        height = np.abs(np.einsum("mkx,mx->mk", way, normal.astype(np.float64)))
        lift = self._scene.triangle_lifts[places.triangle[subset], None]
        return index, np.where(height <= _FLAT * distance + 2 * lift, distance, np.inf)


class _Handed:
    """What has become of places so far."""

    def __init__(self, count):
        self.chosen = np.full(count, -1, np.int32)
        self.short = np.zeros(count, np.uint8)


def _triangles_near(scene):
    """(n_triangles,) bool: triangles with details, and their neighbours."""
    holds = np.zeros(len(scene.triangles), bool)
    if not len(scene.details):
        return holds
    holds[scene.details.triangle] = True
    points = np.zeros(len(scene.points), bool)
    points[scene.lattice[np.repeat(holds, scene.lattice_sizes)]] = True
    return np.logical_or.reduceat(points[scene.lattice], scene.lattice_start)
