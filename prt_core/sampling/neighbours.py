"""Which points are asked about a new one: levels that cover the surface, and who surrounds it."""

import numpy as np
from scipy.spatial import cKDTree

from prt_core.rays import boxes_around

# How far apart two points count whose normals differ by 1: in units of the scene's size, and of
# that of their group where it is small.
_NORMAL, _OF_GROUP = 0.05, 0.2
# Groups are this far apart, beyond any distance inside a scene.
_APART = 10.0
# How much further a neighbour may be if it lies on the side where none is yet.
_SAME_SIDE = 1.0


def surface_levels(points, groups, first, growth, rng):
    """Points in levels, each spread evenly over the surface and denser than the one before.

    Strata are stretches of a Morton curve through each group; a level takes one point at
    random from each, so that no part of the surface is left out, nor is a regular mesh sampled
    in step with its rows.

    Parameters
    ----------
    points : BakePoints
    groups : (n_points,) int
        Of points that may be neighbours (see `groups.alike`).
    first : int
        Points in the first level.
    growth : float
        How many times as many are known after each level.
    rng : numpy.random.Generator

    Returns
    -------
    list of (n,) int64
        Every point once; each level in the curve's order.
    """
    n_points = len(points)
    rest = np.lexsort((morton(*_places(points, groups)), groups))
    levels, known = [], 0
    while len(rest):
        wanted = first if not known else max(1, round(known * (growth - 1)))
        # The last level takes all: a handful left over would cost as much as a whole level.
        if known + wanted * 1.25 >= n_points or wanted >= len(rest):
            levels.append(rest)
            break
        edges = np.linspace(0, len(rest), wanted + 1).astype(np.int64)
        taken = edges[:-1] + (rng.random(wanted) * np.diff(edges)).astype(np.int64)
        levels.append(rest[taken])
        rest = np.delete(rest, taken)
        known += wanted
    return levels


class Neighbours:
    """The known points around others: near in position and normal, on all sides of them.

    Parameters
    ----------
    points : BakePoints
    groups : (n_points,) int
        Points of different ones are no neighbours.
    """

    def __init__(self, points, groups):
        # In float64: with thousands of groups apart from each other float32 would be coarse.
        places, extent = _places(points, groups)
        weight = np.minimum(_NORMAL, _OF_GROUP * extent)[:, None]
        self._features = np.hstack([places, weight * points.normals, _APART * groups[:, None]])

    def around(self, known, wanted, n_neighbours, n_candidates, itself=False):
        """Neighbours of some points among the known.

        The nearest, and then those of the candidates that are near but on another side, for what
        lies between known points is surer than what lies beyond them.

        Parameters
        ----------
        known, wanted : (n_known,), (n,) int
        n_neighbours, n_candidates : int
        itself : bool
            Whether `wanted` are among `known`; a point is not its own neighbour.

        Returns
        -------
        (n, n_neighbours) int64
            -1 where there are not so many in the same group.
        """
        if not len(wanted) or not len(known):
            return np.full((len(wanted), n_neighbours), -1, np.int64)
        n_asked = min(n_candidates + itself, len(known))
        tree = cKDTree(self._features[known])
        here = self._features[wanted]
        distance, index = tree.query(here, k=n_asked, workers=-1)
        distance = distance.reshape(len(wanted), -1).astype(np.float32)
        near = known[index.reshape(len(wanted), -1)]
        distance[(distance > _APART / 2) | ((near == wanted[:, None]) & itself)] = np.inf
        way = (self._features[near] - here[:, None]).astype(np.float32)
        way /= np.maximum(np.linalg.norm(way, axis=2, keepdims=True), 1e-12)
        rows = np.arange(len(wanted))
        chosen = np.full((len(wanted), n_neighbours), -1, np.int64)
        side = np.zeros_like(distance)
        for turn in range(min(n_neighbours, n_asked)):
            cost = distance * (1 + _SAME_SIDE * side)
            best = cost.argmin(axis=1)
            usable = np.isfinite(distance[rows, best])
            chosen[usable, turn] = near[rows, best][usable]
            cosine = np.einsum("nkf,nf->nk", way, way[rows, best])
            side = np.maximum(side, 1 + cosine)
            distance[rows, best] = np.inf
        return chosen


def _places(points, groups):
    """Positions from the low corner of each point's group, and the size of that group."""
    low, high = boxes_around(groups, points.positions)
    return points.positions - low[groups], (high - low).max(axis=1)[groups]


def morton(places, extent):
    """(n,) uint64: where places (n, 3), from 0 to `extent`, lie along a Morton curve."""
    scale = 1023 / np.maximum(extent, 1e-300)
    code = np.zeros(len(places), np.uint64)
    for axis in range(3):
        x = (places[:, axis] * scale).astype(np.uint64)
        for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
            x = (x | (x << np.uint64(shift))) & np.uint64(mask)
        code |= x << np.uint64(axis)
    return code
