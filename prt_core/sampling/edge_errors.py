"""What the middle of each edge would spare of the error that colours make between vertices.

A renderer draws straight lines between the colours of corners. How far that is from the light is
known at *places*: the middles of edges and some places inside of triangles, each with the light
that arrives there. A vertex in the middle of an edge would change what is drawn by a hat over the
triangles at that edge; what its place and the places under the hat would gain is a sum over them.
The middles are those that may become vertices, so no ray is cast in vain.

Where middles tell nothing, a shadow within a large triangle, its longest edge is split for a part
of its error.
"""

from dataclasses import fields

import numpy as np

from prt_core.scene import BakePoints, surface_points
from prt_core.scene.paint import centroids
from prt_core.scene.points_of_meshes import NORMAL_STEP

# Places inside of all triangles together: so many for each, and at least so many; of one at most.
_FOR_EACH, _LEAST, _MOST_ALONG = 1, 20_000, 24
# Places lie this share of the way to the middle of their triangle: what stands on its rim is not in
# the way of what is shown beside it.
_INSIDE = 1e-4
# An edge shorter than this share of the longest of its triangle waits for that: no slivers.
_SHORT = 0.3
# The share of its error for which a triangle asks for its longest edge.
_UNKNOWN = 0.2
# Places asked for their light together.
_TOGETHER = 1 << 14


class EdgeErrors:
    """The light at places of triangles while these are split.

    Parameters
    ----------
    state : SplitMeshes
        Of the scene's meshes; nothing is split yet.
    scene : Scene
    solid : (n_at_first,) bool
        Which of all triangles those of the scene are, in order.
    light : PlaceLight
    """

    def __init__(self, state, scene, solid, light):
        self._state, self._scene, self._light = state, scene, light
        self._of_scene = np.where(solid, np.cumsum(solid) - 1, -1)
        receives = np.array([item.receives for item in scene.objects], bool)
        self._shown = solid.copy()
        self._shown[solid] = receives[scene.triangle_object]
        albedo = scene.points.mean_albedo.mean(axis=1, dtype=np.float64)
        sums = np.add.reduceat(albedo[scene.lattice], scene.lattice_start) / scene.lattice_sizes
        corners = scene.vertices[scene.triangles]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # What a triangle's squared error counts: its area, by what it makes of the light.
        self._worth = np.zeros(len(solid))
        self._worth[solid] = np.linalg.norm(cross, axis=1) / 2 * sums**2
        self._worth[~self._shown] = 0

    def begin(self):
        """Ask for the light at first; a generator of `Progress`."""
        n, channels = len(self._state.triangles), len(self._light.channels)
        self._corner, self._middle = np.full((2, n, 3, channels), np.nan)
        area = self._worth > 0
        size = np.sqrt(self._areas())
        share = size / max(np.sqrt((size[area] ** 2).sum()), 1e-300)
        along = share * np.sqrt(max(_FOR_EACH * area.sum(), _LEAST))
        along = np.clip(np.rint(along), 1, _MOST_ALONG).astype(np.int64)
        self._where, self._at = np.zeros(0, np.int64), np.zeros((0, 3))
        self._value = np.zeros((0, channels))
        for count in np.unique(along[area]):
            mine = np.flatnonzero(area & (along == count))
            second, third = centroids(int(count)).T
            places = np.stack([1 - second - third, second, third], axis=1)
            yield from self._add(np.repeat(mine, len(places)), np.tile(places, (len(mine), 1)))
        yield from self._fill()
        # Of each group the light of all its lamps is what its errors are relative to.
        groups = [channel.group for channel in self._light.channels]
        self.groups = list(dict.fromkeys(groups))
        self._group = np.array([self.groups.index(group) for group in groups])
        sums = np.zeros((n, len(self.groups)))
        for index in range(len(self.groups)):
            together = self._corner[:, :, self._group == index].sum(axis=2)
            sums[:, index] = (together**2).mean(axis=1) * self._worth
        size = np.sqrt(sums.sum(axis=0))
        shares = np.array([channel.share for channel in self._light.channels])
        self._scale = np.where(size > 0, 1 / np.maximum(size, 1e-300), 0)[self._group] * shares

    def _areas(self):
        corners = self._state.vertices[self._state.triangles]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return np.linalg.norm(cross, axis=1) / 2

    def _add(self, where, at):
        """More places inside of triangles."""
        values = yield from self._measured(where, at)
        self._where = np.append(self._where, where)
        self._at = np.concatenate([self._at, at])
        self._value = np.concatenate([self._value, values])

    def _fill(self):
        """Corners and middles that are not known yet."""
        state = self._state
        for known, places, number in (
            (self._corner, np.eye(3), state.triangles),
            (self._middle, np.array([[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]]), state.edges),
        ):
            known[self._worth[state.parent] == 0] = 0
            where, which = np.nonzero(np.isnan(known[:, :, 0]))
            known[where, which] = yield from self._measured(
                where, places[which], number[where, which]
            )

    def _measured(self, where, at, number=None):
        """(m, n_channels) light at places of triangles.

        What has one `number` and one normal is one place.
        """
        if not len(where):
            return np.zeros((0, len(self._light.channels)))
        within = at * (1 - _INSIDE) + _INSIDE / 3
        whole = np.einsum("mk,mkj->mj", within, self._state.barycentric[where])
        triangle = self._of_scene[self._state.parent[where]]
        front = np.zeros(len(where), bool)
        points, _ = surface_points(self._scene, triangle, whole[:, 1:], front)
        which = np.arange(len(where))
        if number is not None:
            key = np.column_stack(
                [number, points.object_index, np.rint(points.normals / NORMAL_STEP)]
            )
            _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
            points, which = _some(points, first), which.reshape(-1)
        values = np.empty((len(points), len(self._light.channels)))
        for start in range(0, len(points), _TOGETHER):
            part = slice(start, start + _TOGETHER)
            values[part] = yield from self._light.steps(_some(points, part))
        return values[which]

    def _residuals(self):
        """What the light differs from what is drawn: at middles, and at places inside."""
        corner, scale = self._corner, self._scale
        drawn = (corner + np.roll(corner, -1, axis=1)) / 2
        inside = np.einsum("pk,pkc->pc", self._at, corner[self._where])
        return (self._middle - drawn) * scale, (self._value - inside) * scale

    def scores(self):
        """Of each edge what its middle is worth, and of each group the relative L2 error now.

        Returns
        -------
        (n_edges,) float64
            Squared relative error that it would spare, or is asked for.
        dict of str -> float
        """
        state = self._state
        middle, inside = self._residuals()
        worth = self._worth[state.parent] * self._shares()
        count = 3 + np.bincount(self._where, minlength=len(worth))
        weight = worth / count
        squared = (middle**2).sum(axis=1)
        for channel, column in enumerate((inside**2).T):
            squared[:, channel] += np.bincount(self._where, column, len(worth))
        errors = squared * weight[:, None]
        gain = (middle**2).sum(axis=2)
        for edge in range(3):
            hat = 2 * np.minimum(self._at[:, edge], self._at[:, (edge + 1) % 3])
            lift = hat[:, None] * middle[self._where, edge]
            spared = (lift * (2 * inside - lift)).sum(axis=1)
            gain[:, edge] += np.bincount(self._where, spared, len(worth))
        gain = np.maximum(gain, 0) * weight[:, None]
        lengths = state.lengths
        rows, longest = np.arange(len(lengths)), lengths.argmax(axis=1)
        gain[rows, longest] += _UNKNOWN * errors.sum(axis=1)
        short = lengths < _SHORT * lengths[rows, longest][:, None]
        waiting = np.where(short, gain, 0).sum(axis=1)
        gain[short] = 0
        gain[rows, longest] += waiting
        scores = np.bincount(state.edges.ravel(), gain.ravel(), state.n_edges)
        groups = np.bincount(self._group, errors.sum(axis=0), len(self.groups))
        return scores, dict(zip(self.groups, np.sqrt(groups).tolist(), strict=True))

    def _shares(self):
        """(n,) which part of the triangle that it came from each is."""
        return np.abs(np.linalg.det(self._state.barycentric))

    def follow(self, of, template, local):
        """The triangles were split: a generator of `Progress`.

        Parameters
        ----------
        of, template
            As `SplitMeshes.split` returns them.
        local : (n, 3, 3) float64
            Weights of the corners of `of` at each of the triangles' own.
        """
        n_before = len(self._corner)
        six = np.concatenate([self._corner, self._middle], axis=1)
        self._corner = np.take_along_axis(six[of], template[:, :, None], axis=1)
        # An edge that is whole leaves one old corner for the next.
        whole = (template < 3) & (np.roll(template, -1, axis=1) == (template + 1) % 3)
        middle = self._middle[of[:, None], np.minimum(template, 2)]
        self._middle = np.where(whole[:, :, None], middle, np.nan)
        self._hand_on(of, local, n_before)
        bare = np.bincount(self._where, minlength=len(of)) == 0
        bare &= self._worth[self._state.parent] > 0
        bare = np.flatnonzero(bare)
        yield from self._add(bare, np.full((len(bare), 3), 1 / 3))
        yield from self._fill()

    def _hand_on(self, of, local, n_before):
        """Each place to the child that it lies in."""
        count = np.bincount(of, minlength=n_before)
        first = np.cumsum(count) - count
        best = np.full(len(self._where), -np.inf)
        where, at = self._where.copy(), self._at.copy()
        inverse = np.linalg.inv(local)
        for child in range(int(count.max(initial=0))):
            rows = np.flatnonzero(count[self._where] > child)
            target = first[self._where[rows]] + child
            weights = np.einsum("pk,pkj->pj", self._at[rows], inverse[target])
            deeper = weights.min(axis=1) > best[rows]
            rows, target = rows[deeper], target[deeper]
            best[rows] = weights[deeper].min(axis=1)
            where[rows], at[rows] = target, weights[deeper]
        self._where, self._at = where, at


def _some(points, which):
    """Some of `BakePoints`."""
    return BakePoints(**{f.name: getattr(points, f.name)[which] for f in fields(BakePoints)})
