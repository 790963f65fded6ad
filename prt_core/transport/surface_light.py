"""`SurfaceLight`: the emissive triangles of one material, sampled as a lamp is.

The triangles are cut until there are many small pieces, each of which emits about evenly; pieces
that lie together make a cluster. For a point, a cluster is chosen in proportion to a bound of what
it may send there (its power, distance and the two cosines, after Estevez and Kulla, "Importance
Sampling of Many Lights with Adaptive Tree Splitting", 2018), in it a piece in proportion to its
power, and on the piece any place. So thousands of small triangles cost as little as two large
ones, and a texture is sampled where it is bright. Both faces emit.
"""

import numpy as np

# Triangles are cut until there are so many pieces; clusters of pieces, at most.
_PIECES, _CLUSTERS = 1024, 128
# Places on a piece, by the weights of its three corners, whose mean is its emission.
_PLACES = np.array([[2, 2, 2], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6


class SurfaceLight:
    """The triangles of one emitter of a scene.

    Parameters
    ----------
    scene : Scene
    index : int
        In `Scene.emitters`.

    Attributes
    ----------
    name : str
    radiance : (3,) float64
        Mean over its triangles.
    area : float
        Of its triangles, in squared frame units.
    """

    def __init__(self, scene, index):
        self.name, self._scene = scene.emitters[index], scene
        triangles = np.flatnonzero(scene.triangle_emitter == index)
        self._pieces = pieces = _Pieces(scene, triangles)
        places = np.einsum("pk,nkc->npc", _PLACES, pieces.corners)
        emission = scene.emission_at(
            np.repeat(pieces.triangle, len(_PLACES)), places.reshape(-1, 3)[:, 1:]
        )
        emission = emission.reshape(len(places), len(_PLACES), 3).mean(axis=1)
        self.area = float(pieces.area.sum())
        self.radiance = pieces.area @ emission / max(self.area, 1e-300)
        value = emission.max(axis=1)
        # What most pieces are as bright as costs the fewest numbers.
        power = pieces.area * (value / max(value.max(), 1e-300))
        self._make_clusters(power)

    @property
    def is_dark(self):
        """Whether no piece of it emits."""
        return not len(self._power)

    def _make_clusters(self, power):
        pieces = self._pieces
        lit = np.flatnonzero(power > 0)
        middle = pieces.positions.mean(axis=1)
        groups = _near_each_other(middle[lit], _CLUSTERS)
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
        normal = pieces.normal[order]
        outer = (normal[:, :, None] * normal[:, None]).reshape(-1, 9)
        self._facing = _summed(cluster, share[:, None] * outer, n).reshape(-1, 3, 3)
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
        moment = self._facing.reshape(-1, 9)
        twice = positions[:, :, None] * positions[:, None]
        turned = np.einsum("cij,cj->ci", self._facing, self._centre)
        constant = np.einsum("ci,ci->c", turned, self._centre)
        # The mean of (n . way)^2 over the normals n of a cluster, for the way from each point.
        faced = twice.reshape(-1, 9) @ moment.T - 2 * positions @ turned.T + constant
        squares = (positions**2).sum(axis=1)[:, None] - 2 * positions @ self._centre.T
        squares = np.maximum(squares + (self._centre**2).sum(axis=1), 1e-300)
        height = normals @ self._centre.T - np.einsum("nx,nx->n", normals, positions)[:, None]
        away = np.sqrt(squares)
        wide = np.minimum(self._radius / away, 1)
        received = np.clip(height / away + wide, 0, 1)
        sent = np.minimum(np.sqrt(np.maximum(faced, 0) / squares) + wide, 1)
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

    def __init__(self, scene, triangles):
        self._first = np.full(len(scene.triangles), -1, np.int64)
        self._first[triangles] = np.arange(len(triangles))
        triangle, corners = triangles, np.broadcast_to(np.eye(3), (len(triangles), 3, 3))
        positions = scene.vertices[scene.triangles[triangles]]
        edge, children = np.zeros(len(triangles), np.int64), np.full((len(triangles), 2), -1)
        leaves = np.arange(len(triangles))
        while len(leaves) < _PIECES:
            length = np.linalg.norm(
                positions[leaves][:, [1, 2, 0]] - positions[leaves], axis=2
            )
            longest = length.max(axis=1)
            cut = np.flatnonzero(longest >= 0.75 * longest.max())
            cut = cut[np.argsort(-longest[cut], kind="stable")][: _PIECES - len(leaves)]
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


def _near_each_other(places, count):
    """Indices of `places` (n, 3) in at most `count` groups, by halving the longest side."""
    groups = [np.arange(len(places))] if len(places) else []
    while groups and len(groups) * 2 <= count and max(map(len, groups)) > 1:
        halves = []
        for group in groups:
            axis = np.ptp(places[group], axis=0).argmax()
            group = group[np.argsort(places[group, axis], kind="stable")]
            halves += [half for half in np.array_split(group, 2) if len(half)]
        groups = halves
    return groups


def _summed(group, values, count):
    """(count, k) sums of `values` (n, k) by `group`."""
    return np.stack([np.bincount(group, column, count) for column in values.T], axis=1)
