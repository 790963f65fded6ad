"""Sparse precomputation of the visibility after Huang & Ramamoorthi (2010), whole.

A quarter of the points, chosen by exploration, is sampled densely but adaptively in angle; every
other point is a sparse combination of the dense points around it, found from a few hundred
directions that tell them apart. What comes out is thresholded to bits.
"""

import time
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from prt_core.errors import expect
from prt_core.progress import Progress
from prt_core.reconstruct import gram, l1_batched, least_squares
from prt_core.sampling.adaptive_angle import AngularGrid
from prt_core.sampling.columns import best_columns, feature_weights, with_surroundings
from prt_core.sampling.dense import dense_steps
from prt_core.sampling.sampled import Sampled, register_sampler
from prt_core.sampling.tracer import Tracer
from prt_core.transport.visibility import horizon_bits, unpack

RECONSTRUCTIONS = ("l1", "least_squares", "full")
# Sparse points whose rays are cast at once, and whose neighbourhoods are taken together; they lie
# side by side.
_BLOCK, _GROUP = 4096, 64


@dataclass(frozen=True)
class HuangSettings:
    """Settings of `sample_huang`; the defaults are the paper's.

    Parameters
    ----------
    dense_share, first_share : float
        Share of each object's points that are dense, and of those of the first iteration.
    iterations : int
        After the first.
    window : int
        Texels of the window that decides about directions of dense points.
    features : int
        Directions traced at each sparse point.
    radius : float
        Of neighbourhoods, in units of the scene's size: the paper's 0.2 on a ground of 4.
    normal_weight : float
        Neighbours are nearest in position and, with this weight, in normal; 0 is the paper's.
    neighbours : int
        Dense points that a sparse one is made of, at most: the nearest.
    fewest : int
        So many neighbours are taken even from beyond the radius.
    rank_neighbours : int
    rank_threshold : float
        Singular values below this share of the largest do not count.
    rank_power : float
        Points are drawn in proportion to this power of their rank; 1 is the paper's.
    reconstruction : {"l1", "least_squares", "full"}
    strength : float
        lambda of the sparse solutions, as a share of the least that makes them zero.
    quantity : {"transport", "visibility"}
        What is combined linearly: rows of T, or visibility weighted by each point's own cosine.
    threshold : float
        A direction is seen where the combination is above this share of its unoccluded value.
    fewest_dense : int
        Dense points of even the smallest object.
    seed : int
    """

    dense_share: float = 0.25
    first_share: float = 0.05
    iterations: int = 4
    window: int = 7
    features: int = 350
    radius: float = 0.05
    normal_weight: float = 0.02
    neighbours: int = 16
    fewest: int = 4
    rank_neighbours: int = 12
    rank_threshold: float = 0.1
    rank_power: float = 1.0
    reconstruction: str = "l1"
    strength: float = 1e-2
    quantity: str = "transport"
    threshold: float = 0.4
    fewest_dense: int = 8
    seed: int = 0

    def __post_init__(self):
        for name in ("dense_share", "first_share", "threshold"):
            value = getattr(self, name)
            expect(0 < value <= 1, f"{name}: expected a number above 0, at most 1, got {value}")
        for name in ("features", "neighbours", "fewest", "rank_neighbours", "fewest_dense"):
            value = getattr(self, name)
            expect(
                isinstance(value, int) and value >= 1,
                f"{name}: expected a whole number >= 1, got {value!r}",
            )
        expect(
            isinstance(self.iterations, int) and self.iterations >= 0,
            f"iterations: expected a whole number >= 0, got {self.iterations!r}",
        )
        expect(
            isinstance(self.window, int) and self.window >= 3 and self.window % 2 == 1,
            f"window: expected an odd number >= 3, got {self.window!r}",
        )
        for name in ("radius", "strength", "rank_power"):
            value = getattr(self, name)
            expect(np.isfinite(value) and value > 0, f"{name}: expected a number > 0, got {value}")
        expect(
            np.isfinite(self.normal_weight) and self.normal_weight >= 0,
            f"normal_weight: expected a number >= 0, got {self.normal_weight}",
        )
        expect(
            self.reconstruction in RECONSTRUCTIONS,
            f"reconstruction: expected one of {', '.join(RECONSTRUCTIONS)}, "
            f"got '{self.reconstruction}'",
        )
        expect(
            self.quantity in ("transport", "visibility"),
            f"quantity: expected transport or visibility, got '{self.quantity}'",
        )


def sample_huang(scene, cube_map, caster, settings=None, tally=None, pace=None):
    """Visibility from dense and sparse points; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : HuangSettings
    tally : callable(int), optional
        Told the number of rays of each batch.
    pace : Pace, optional
        In rays; the result is the same.

    Returns
    -------
    Sampled
        `facts`: dense_points, dense_entries, sparse_entries, mean_rank, neighbours_used (of each
        sparse point, mean) and duality_gap (the largest, as a share of |y|^2).
    """
    settings = settings or HuangSettings()
    seconds = {}
    clock = _Clock(seconds)
    tracer = Tracer(scene, cube_map, caster, tally, pace)
    grid = AngularGrid(cube_map, settings.window)
    dense = yield from clock.around("dense", dense_steps(scene, tracer, grid, settings))
    dense_rays = tracer.rays
    shape = len(scene.points), -(-cube_map.n_directions // 8)
    bits, traced = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    bits[dense.points], traced[dense.points] = dense.rows.bits, dense.rows.traced
    filler = _Filler(scene, cube_map, tracer, dense, settings, clock)
    for points, neighbours in sparse_groups(scene, dense, settings):
        bits[points], traced[points] = yield from filler.fill(points, neighbours)
    facts = {
        "dense_points": len(dense.points),
        "dense_entries": dense_rays,
        "sparse_entries": tracer.rays - dense_rays,
        "mean_rank": float(dense.rank.mean()) if len(dense.rank) else 0.0,
        **filler.facts(),
    }
    return Sampled(bits, traced, tracer.rays, seconds, facts)


class _Clock:
    """Adds the time that a generator works, not that its caller takes, to a stage."""

    def __init__(self, seconds):
        self.seconds = seconds

    def around(self, stage, steps):
        start = time.perf_counter()
        try:
            while True:
                progress = next(steps)
                self._add(stage, start)
                yield progress
                start = time.perf_counter()
        except StopIteration as end:
            self._add(stage, start)
            return end.value

    def _add(self, stage, start):
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start


def sparse_groups(scene, dense, settings):
    """Sparse points side by side, and the dense points around them.

    Yields
    ------
    points : (n,) int64
    neighbours : (n, k) int64
        Places in `dense.points`, nearest first; -1 where there are fewer.
    """
    is_dense = np.zeros(len(scene.points), bool)
    is_dense[dense.points] = True
    positions = scene.points.positions
    places_of = np.hstack([positions, settings.normal_weight * scene.points.normals])
    for index in range(len(scene.objects)):
        mine = scene.points.object_index == index
        sparse = np.flatnonzero(mine & ~is_dense)
        if not len(sparse):
            continue
        places = np.flatnonzero(mine[dense.points])
        # The tree's own order of points is one of neighbours.
        sparse = sparse[cKDTree(positions[sparse], leafsize=_GROUP).indices]
        tree = cKDTree(places_of[dense.points[places]])
        k = min(settings.neighbours, len(places))
        for first in range(0, len(sparse), _BLOCK):
            some = sparse[first : first + _BLOCK]
            distance, near = tree.query(places_of[some], k=range(1, k + 1))
            taken = (distance <= settings.radius) | (np.arange(k) < settings.fewest)
            yield some, np.where(taken, places[near], -1)


class _Filler:
    """Traces the features of sparse points and reconstructs their rows."""

    def __init__(self, scene, cube_map, tracer, dense, settings, clock):
        self.scene, self.cube_map, self.tracer, self.dense = scene, cube_map, tracer, dense
        self.settings, self.clock = settings, clock
        self.vectors = np.ascontiguousarray(cube_map.vectors.T, np.float32)
        self.gap, self.nonzero, self.solved = 0.0, 0, 0

    def facts(self):
        return {
            "duality_gap": self.gap,
            "neighbours_used": self.nonzero / max(self.solved, 1),
        }

    def fill(self, points, neighbours):
        """(bits, traced) of sparse points; a generator of `Progress`."""
        n_directions = self.cube_map.n_directions
        above = unpack(horizon_bits(self.scene, self.cube_map, points), n_directions, np.uint8)
        above = above.view(bool)
        wanted, columns, valid = yield from self.clock.around(
            "features", self._features(points, neighbours, above)
        )
        wanted = np.packbits(wanted, axis=1, bitorder="little")
        seen = yield from self.clock.around("sparse rays", self.tracer.trace(points, wanted))
        free = unpack(seen, n_directions, np.uint8)
        filled = yield from self.clock.around(
            "reconstruction", self._rows(points, neighbours, above, free, columns, valid)
        )
        filled = np.packbits(filled, axis=1, bitorder="little")
        return (filled & ~wanted) | seen, wanted

    def _groups(self, neighbours):
        """Slices of points, the dense rows they need, and their neighbours among these."""
        for first in range(0, len(neighbours), _GROUP):
            part = slice(first, min(first + _GROUP, len(neighbours)))
            near = neighbours[part]
            used, local = np.unique(near, return_inverse=True)
            local = local.reshape(near.shape)
            if used[0] < 0:
                used, local = used[1:], local - 1
            yield part, used, local

    def _transport(self, used):
        """(n, n_directions) float32: what is combined, of dense points."""
        seen = unpack(self.dense.rows.bits[used], self.cube_map.n_directions)
        if self.settings.quantity == "transport":
            seen *= self._cosine(self.dense.points[used])
        return seen

    def _cosine(self, points):
        return np.maximum(self.scene.points.normals[points] @ self.vectors, 0)

    def _features(self, points, neighbours, above):
        m = min(self.settings.features, self.cube_map.n_directions)
        if self.settings.reconstruction == "full":
            m = self.cube_map.n_directions
        columns = np.empty((len(points), m), np.int64)
        valid = np.empty((len(points), m), bool)
        for part, used, local in self._groups(neighbours):
            if self.settings.reconstruction == "full":
                columns[part], valid[part] = np.arange(m), above[part]
                continue
            features = unpack(self.dense.rows.features[used], self.cube_map.n_directions)
            weights = feature_weights(self._transport(used), features, local)
            weights = with_surroundings(weights, self.cube_map.resolution)
            columns[part], valid[part] = best_columns(weights, above[part], m)
            yield Progress("features", part.stop, len(points))
        wanted = np.zeros(above.shape, bool)
        row, column = np.nonzero(valid)
        wanted[row, columns[row, column]] = True
        return wanted, columns, valid

    def _rows(self, points, neighbours, above, free, columns, valid):
        result = np.empty_like(above)
        for part, used, local in self._groups(neighbours):
            rows = self._transport(used)
            cosine = self._cosine(points[part])
            padded = np.concatenate([rows, np.zeros((1, rows.shape[1]), np.float32)])
            picked = columns[part]
            a = padded[local[:, :, None], picked[:, None, :]]
            own = np.take_along_axis(cosine, picked, axis=1) * valid[part]
            y = np.take_along_axis(free[part], picked, axis=1) * own
            a *= own[:, None] if self.settings.quantity == "visibility" else valid[part][:, None]
            weights = self._solve(a, y)
            self.nonzero += int(np.count_nonzero(weights))
            self.solved += len(weights)
            spread = np.zeros((len(weights), len(padded)), np.float32)
            np.add.at(spread, (np.arange(len(weights))[:, None], local), weights)
            row = spread[:, :-1] @ rows
            limit = self.settings.threshold
            if self.settings.quantity == "transport":
                limit = limit * cosine
            result[part] = (row > limit) & above[part]
            yield Progress("reconstruction", part.stop, len(points))
        return result


    def _solve(self, a, y):
        """(n, k) float32: weights of the neighbours."""
        grams, moments, squares = gram(a, y)
        if self.settings.reconstruction != "l1":
            return least_squares(grams, moments)[0].astype(np.float32)
        # Where nothing is seen the solution is zero for every lambda.
        strengths = self.settings.strength * np.abs(moments).max(axis=1, initial=0)
        found = l1_batched(grams, moments, squares, np.maximum(strengths, 1e-30))
        share = found.gap / np.maximum(squares, 1e-30)
        self.gap = max(self.gap, float(share.max(initial=0)))
        return found.weights.astype(np.float32)


register_sampler("huang", sample_huang, HuangSettings)
