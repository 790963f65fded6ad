"""`SurfaceLight`: the emissive triangles of one material, sampled as a lamp is.

The triangles are cut until there are many small pieces, each of which emits about evenly; pieces
that lie together make a cluster. For a point, a cluster is chosen in proportion to a bound of what
it may send there (its power, distance and the two cosines, after Estevez and Kulla, "Importance
Sampling of Many Lights with Adaptive Tree Splitting", 2018), in it a piece in proportion to its
power, and on the piece any place. So thousands of small triangles cost as little as two large
ones, and a texture is sampled where it is bright.

Both faces emit, each what it does, but of a closed surface, a tube or a bulb, one is seen by
nobody. A side from which a few rays meet nothing but the emitter itself is not sampled: half of all
shadow rays would end at the near wall of the tube. Where that is wrong the emitter fills what a
point sees, and the other kind of rays finds it (see `transport.emission`).
"""

import heapq

import numpy as np

from prt_core.runtime.seeds import Stage, generator
from prt_core.transport.gather import cosine_directions

# Clusters of an emitter, at most, and pieces of each that triangles are cut into.
MOST_CLUSTERS = 256
_PIECES = 8
# Rays from each side of a piece that tell whether anything else sees it.
_LOOKS = 8
# Places on a piece, by the weights of its three corners, whose mean is its emission.
_PLACES = np.array([[2, 2, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6


class SurfaceLight:
    """The triangles of one emitter of a scene.

    Parameters
    ----------
    scene : Scene
    index : int
        In `Scene.emitters`.
    n_clusters : int
        At most.

    Attributes
    ----------
    name : str
    radiance : (3,) float64
        Mean over its triangles and their two sides.
    area : float
        Of its triangles, in squared frame units.
    n_rays : int
        That were cast to see which sides are open.
    """

    def __init__(self, scene, index, n_clusters=MOST_CLUSTERS):
        self.name, self.n_rays, self._n_clusters = scene.emitters[index], 0, n_clusters
        self._scene, self._index = scene, index
        triangles = np.flatnonzero(scene.triangle_emitter == index)
        self._pieces = pieces = _Pieces(scene, triangles, _PIECES * n_clusters)
        places = np.einsum("pk,nkc->npc", _PLACES, pieces.corners)
        triangle = np.repeat(pieces.triangle, len(_PLACES))
        emission = np.stack(
            [
                scene.emission_at(triangle, places.reshape(-1, 3)[:, 1:], np.full(len(triangle), b))
                for b in (False, True)
            ]
        )
        emission = emission.reshape(2, len(places), len(_PLACES), 3).mean(axis=2)
        self.area = float(pieces.area.sum())
        self.radiance = pieces.area @ emission.mean(axis=0) / max(self.area, 1e-300)
        of_side = emission.max(axis=2)
        value = of_side.max(axis=0)
        # What most pieces are as bright as costs the fewest numbers.
        self._piece_power = pieces.area * (value / value.max(initial=1e-300))
        self._share_of_side = of_side / np.maximum(value, 1e-300)

    def look_around(self, caster, seed=0):
        """Find which sides others may see, and cluster the pieces by it; before any sample.

        Parameters
        ----------
        caster : RayCaster
        seed : int
        """
        power = self._piece_power
        sides = self._open_sides(self._scene, self._index, caster, seed, power > 0)
        self._make_clusters(power, sides * self._share_of_side)

    def _open_sides(self, scene, index, caster, seed, lit):
        """(2, n_pieces) float64: whether the front, the back may be seen by others."""
        pieces, sides = self._pieces, np.zeros((2, len(lit)))
        lit = np.flatnonzero(lit)
        middle = pieces.positions[lit].mean(axis=1)
        lift = scene.triangle_lifts[pieces.triangle[lit], None]
        shift = generator(seed, Stage.EMISSION_SIDES, index).random((len(lit), 2), np.float32)
        for side, sign in enumerate((1, -1)):
            normal = sign * pieces.normal[lit]
            ways = cosine_directions(normal.astype(np.float32), shift, _LOOKS).reshape(-1, 3)
            starts = np.repeat(middle + lift * normal, _LOOKS, axis=0)
            if scene.ray_origins.dtype == np.float32:
                starts = starts.astype(np.float32)
            met = [
                caster.intersect(starts[first : first + caster.batch],
                                 ways[first : first + caster.batch]).triangle
                for first in range(0, len(starts), caster.batch)
            ]  # fmt: skip
            met = np.concatenate(met) if met else np.zeros(0, np.int32)
            own = (met >= 0) & (scene.triangle_emitter[met] == index)
            sides[side, lit] = ~own.reshape(-1, _LOOKS).all(axis=1)
            self.n_rays += len(starts)
        return sides

    @property
    def is_dark(self):
        """Whether no piece of it emits."""
        return not self._piece_power.any()

    def _make_clusters(self, power, sides):
        pieces = self._pieces
        lit = np.flatnonzero(power > 0)
        middle = pieces.positions.mean(axis=1)
        # To face otherwise keeps pieces apart as a quarter of the emitter's size does.
        across = max(float(np.ptp(middle, axis=0).max()), 1e-300) if len(middle) else 1.0
        features = np.hstack([middle[lit] / across, pieces.normal[lit] / 8])
        groups = _near_each_other(features, power[lit], self._n_clusters)
        order = lit[np.concatenate(groups)] if len(lit) else lit
        sizes = np.array([len(group) for group in groups], np.int64)
        cluster = np.repeat(np.arange(len(groups)), sizes)
        self._last = np.cumsum(sizes) - 1
        self._first = self._last - sizes + 1
        # Pieces in the order of their clusters, and where the power of each ends.
        self._order, self._until = order, np.cumsum(power[order])
        n = len(groups)
        self._power = np.bincount(cluster, power[order], n)
        self._before = np.cumsum(self._power) - self._power
        share = power[order] / self._power[cluster]
        self._centre = _summed(cluster, share[:, None] * middle[order], n)
        away = pieces.positions[order] - self._centre[cluster, None]
        self._radius = np.zeros(n)
        np.maximum.at(self._radius, cluster, np.linalg.norm(away, axis=2).max(axis=1))
        self._normal = _summed(cluster, share[:, None] * pieces.normal[order], n)
        self._bent = np.sqrt(np.maximum(1 - (self._normal**2).sum(axis=1), 0))
        self._sides = _summed(cluster, share[:, None] * sides.T[order], n).T
        # Of each piece: its cluster, and its chance in that cluster for each unit of area.
        self._cluster = np.zeros(len(power), np.int64)
        self._cluster[order] = cluster
        self._density = np.zeros(len(power))
        self._density[order] = share / pieces.area[order]

    def chances(self, positions, normals):
        """(n, n_clusters) float64: with which chance points sample each cluster.

        Rows are 0 where nothing of the emitter is above a point's horizon.

        Parameters
        ----------
        positions, normals : (n, 3) float64
            In the scene's frame.
        """
        if self.is_dark:
            return np.zeros((len(positions), 0))
        squares = (positions**2).sum(axis=1)[:, None] - 2 * positions @ self._centre.T
        squares = np.maximum(squares + (self._centre**2).sum(axis=1), 1e-300)
        height = normals @ self._centre.T - np.einsum("nx,nx->n", normals, positions)[:, None]
        away = np.sqrt(squares)
        wide = np.minimum(self._radius / away, 1)
        received = np.clip(height / away + wide, 0, 1)
        # The cosine at the emitter, mean over a cluster, and how far off that single pieces are.
        before = positions @ self._normal.T - np.einsum("cx,cx->c", self._normal, self._centre)
        before, about = before / away, self._bent + wide
        front, back = self._sides
        sent = front * np.clip(about + before, 0, 1) + back * np.clip(about - before, 0, 1)
        bound = self._power * received * sent / np.maximum(squares, self._radius**2)
        return bound / np.maximum(bound.sum(axis=1, keepdims=True), 1e-300)

    def sample(self, chances, uv):
        """Places on the emitter, one for each pair of numbers.

        Parameters
        ----------
        chances : (n, n_clusters) float64
            None of its rows 0.
        uv : (n, m, 2) float64 in [0, 1)

        Returns
        -------
        triangle : (n, m) int64
        barycentric : (n, m, 2) float64
        density : (n, m) float64
            Of the choice, for area of the frame.
        """
        rows = np.arange(len(chances))
        until = np.cumsum(chances, axis=1)
        until /= until[:, -1:]
        # One sorted list of all rows, each in a unit of its own.
        flat = (until + rows[:, None]).ravel()
        flat[until.shape[1] - 1 :: until.shape[1]] = rows + 1.0
        wanted = np.minimum(uv[..., 0] + rows[:, None], np.nextafter(rows + 1.0, 0)[:, None])
        cluster = np.searchsorted(flat, wanted, side="right") - rows[:, None] * until.shape[1]
        chance = np.take_along_axis(chances, cluster, axis=1)
        start = np.take_along_axis(until, cluster, axis=1) - chance
        rest = np.clip((uv[..., 0] - start) / chance, 0, 1)
        # What is left of the number chooses the piece, and what is left of that the place.
        target = self._before[cluster] + rest * self._power[cluster]
        place = np.searchsorted(self._until, target, side="right")
        place = np.clip(place, self._first[cluster], self._last[cluster])
        piece = self._order[place]
        power = self._density[piece] * self._pieces.area[piece] * self._power[cluster]
        rest = np.clip(1 - (self._until[place] - target) / power, 0, 1)
        root = np.sqrt(rest)
        weights = np.stack([1 - root, root * (1 - uv[..., 1]), root * uv[..., 1]], axis=-1)
        barycentric = np.einsum("nmk,nmkc->nmc", weights, self._pieces.corners[piece])[..., 1:]
        return self._pieces.triangle[piece], barycentric, chance * self._density[piece]

    def density(self, chances, rows, triangle, barycentric):
        """(m,) float64: how densely `sample` chooses known places, for area of the frame.

        Parameters
        ----------
        chances : (n, n_clusters) float64
        rows : (m,) int
            Of the points for which they would be chosen.
        triangle, barycentric : (m,), (m, 2)
        """
        if self.is_dark:
            return np.zeros(len(rows))
        piece = self._pieces.at(triangle, barycentric)
        return chances[rows, self._cluster[piece]] * self._density[piece]


class _Pieces:
    """Triangles cut in halves along their longest edges until there are many.

    Attributes
    ----------
    triangle : (n,) int64
    corners : (n, 3, 3) float64
        Weights of the triangle's corners at the piece's.
    positions : (n, 3, 3) float64
    normal : (n, 3) float64
    area : (n,) float64
    """

    def __init__(self, scene, triangles, count):
        self._first = np.full(len(scene.triangles), -1, np.int64)
        self._first[triangles] = np.arange(len(triangles))
        triangle, corners = triangles, np.broadcast_to(np.eye(3), (len(triangles), 3, 3))
        positions = scene.vertices[scene.triangles[triangles]]
        edge, children = np.zeros(len(triangles), np.int64), np.full((len(triangles), 2), -1)
        leaves = np.arange(len(triangles))
        while 0 < len(leaves) < count:
            length = np.linalg.norm(positions[leaves][:, [1, 2, 0]] - positions[leaves], axis=2)
            longest = length.max(axis=1)
            cut = np.flatnonzero(longest >= 0.75 * longest.max())
            cut = cut[np.argsort(-longest[cut], kind="stable")][: count - len(leaves)]
            node, turn = leaves[cut], length[cut].argmax(axis=1)
            edge[node] = turn
            children[node] = len(edge) + np.arange(2 * len(node)).reshape(2, -1).T
            triangle = np.concatenate([triangle, triangle[node], triangle[node]])
            corners, positions = (_halved(x, node, turn) for x in (corners, positions))
            edge = np.concatenate([edge, np.zeros(2 * len(node), np.int64)])
            children = np.concatenate([children, np.full((2 * len(node), 2), -1)])
            leaves = np.flatnonzero(children[:, 0] < 0)
        self._edge, self._children = edge, children
        self._piece = np.cumsum(children[:, 0] < 0) - 1
        self.triangle, self.corners = triangle[leaves], corners[leaves]
        self.positions = positions[leaves]
        a, b, c = np.moveaxis(self.positions, 1, 0)
        cross = np.cross(b - a, c - a)
        doubled = np.linalg.norm(cross, axis=1)
        self.area = doubled / 2
        self.normal = cross / np.maximum(doubled, 1e-300)[:, None]

    def at(self, triangle, barycentric):
        """(m,) int64: the piece that holds each place."""
        node = self._first[triangle]
        second, third = np.asarray(barycentric, np.float64).T
        weights = np.stack([1 - second - third, second, third], axis=1)
        while True:
            inner = np.flatnonzero(self._children[node, 0] >= 0)
            if not len(inner):
                return self._piece[node]
            turn = (self._edge[node[inner], None] + np.arange(3)) % 3
            a, b, c = np.take_along_axis(weights[inner], turn, axis=1).T
            first = a >= b
            weights[inner] = np.where(
                first[:, None], np.stack([a - b, 2 * b, c], 1), np.stack([2 * a, b - a, c], 1)
            )
            node[inner] = self._children[node[inner], np.where(first, 0, 1)]


def _halved(values, node, turn):
    """`values` (n, 3, k) of corners, and those of the two halves of each `node`."""
    order = (turn[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(values[node], order[:, :, None], axis=1), 1, 0)
    middle = (a + b) / 2
    return np.concatenate([values, np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])


def _near_each_other(features, power, count):
    """Indices of pieces in at most `count` groups: those of much power over a wide space halved.

    Parameters
    ----------
    features : (n, k) float64
    power : (n,) float64
    count : int
    """
    whole, waiting = [], []

    def add(path, group):
        extent = np.ptp(features[group], axis=0)
        rank = -power[group].sum() * extent.max() ** 2
        heapq.heappush(waiting, (rank, path, int(extent.argmax()), group))

    if len(features):
        add((), np.arange(len(features)))
    while waiting and len(whole) + len(waiting) < count:
        _, path, axis, group = heapq.heappop(waiting)
        values = features[group, axis]
        low = values <= (values.min() + values.max()) / 2
        if low.all():
            whole.append((path, group))
        else:
            add((*path, 0), group[low])
            add((*path, 1), group[~low])
    # Neighbours one after the other: numbers that are spread evenly then are so on the emitter.
    whole += [(path, group) for _, path, _, group in waiting]
    return [group for _, group in sorted(whole, key=lambda item: item[0])]


def _summed(group, values, count):
    """(count, k) sums of `values` (n, k) by `group`."""
    return np.stack([np.bincount(group, column, count) for column in values.T], axis=1)
