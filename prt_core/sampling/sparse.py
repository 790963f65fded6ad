"""Sparse points: a few rays each, the rest a sparse combination of dense points nearby.

Huang & Ramamoorthi 2010, section 5. Points that lie side by side are taken together, and only the
directions about which the dense points around them disagree are worked on: where all of these see
the sky, or none does, a combination of them has nothing to add.
"""

import numpy as np
from scipy.spatial import cKDTree

from prt_core.reconstruct import gram, l1_batched, least_squares
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator
from prt_core.runtime.threads import on_all_cores
from prt_core.sampling.columns import best_columns, feature_weights, membership
from prt_core.sampling.rivals import COLUMN_CHOICES
from prt_core.transport.visibility import horizon_bits, unpack

# Sparse points whose rays are cast at once, and whose neighbourhoods are taken together.
_BLOCK, _GROUP = 4096, 64
# Problems that one thread solves together.
_SOLVED = 512
# A sum of equal shares that is one, but for rounding.
_ALL = np.float32(1 - 1e-4)


def sparse_blocks(scene, dense, settings):
    """Sparse points of each object, side by side, and the dense points around them.

    Parameters
    ----------
    scene : Scene
    dense : DensePoints
    settings : HuangSettings
        radius, normal_weight, neighbours, fewest.

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
            block = sparse[first : first + _BLOCK]
            distance, near = tree.query(places_of[block], k=range(1, k + 1))
            taken = (distance <= settings.radius) | (np.arange(k) < settings.fewest)
            # Nearest first: what no point of the block takes is cut off.
            yield block, np.where(taken, places[near], -1)[:, taken.any(axis=0)]


class SparsePoints:
    """Traces the features of sparse points and reconstructs their rows.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    tracer : Tracer
    dense : DensePoints
    settings : HuangSettings
    clock : callable(stage, generator)
        Adds the time each stage works.
    pace : Pace or None
    factor : callable, optional
        See `sample_huang`.
    """

    def __init__(self, scene, cube_map, tracer, dense, settings, clock, pace, factor=None):
        self.scene, self.cube_map, self.tracer, self.dense = scene, cube_map, tracer, dense
        self.settings, self.clock, self.factor = settings, clock, factor
        # A stop need not wait for all of them.
        self.paced = pace is not None and pace.seconds is not None
        self.vectors = np.ascontiguousarray(cube_map.vectors.T, np.float32)
        self.gap, self.nonzero, self.solved = 0.0, 0, 0
        self._fixed = {}

    def attributes(self):
        """neighbours_used and duality_gap (see `sample_huang`)."""
        return {
            "neighbours_used": self.nonzero / max(self.solved, 1),
            "duality_gap": self.gap,
        }

    def fill(self, points, neighbours):
        """Sample one block; a generator of `Progress`.

        Parameters
        ----------
        points : (n,) int64
            Of one object.
        neighbours : (n, k) int64

        Returns
        -------
        bits, traced : (n, n_bytes) uint8
        """
        combined, seen, wanted = yield from self.sample(points, neighbours)
        return (combined & ~wanted) | seen, wanted

    def sample(self, points, neighbours):
        """As `fill`, but what the combinations say of every direction is kept apart.

        Returns
        -------
        combined, seen, wanted : (n, n_bytes) uint8
            Combined rows; of the traced directions those that are seen; the traced directions.
        """
        above = horizon_bits(self.scene, self.cube_map, points)
        groups = [
            _Group(slice(first, first + _GROUP), points, neighbours, above, self.dense)
            for first in range(0, len(points), _GROUP)
        ]
        columns = yield from self.clock("features", self._each(groups, self._columns))
        wanted = np.concatenate(
            [
                self._wanted(group, *solutions)
                for group, solutions in zip(groups, columns, strict=True)
            ]
        )
        seen = yield from self.clock("sparse rays", self.tracer.trace(points, wanted))
        jobs = [
            (group, seen[group.part], *solutions)
            for group, solutions in zip(groups, columns, strict=True)
        ]
        problems = yield from self.clock("reconstruction", self._each(jobs, self._problems))
        problems = [np.concatenate(parts) for parts in zip(*problems, strict=True)]
        parts = [
            tuple(values[first : first + _SOLVED] for values in problems)
            for first in range(0, len(points), _SOLVED)
        ]
        solved = yield from self.clock("reconstruction", self._each(parts, self._solve))
        weights = np.concatenate([solutions for solutions, _ in solved])
        self.gap = max(self.gap, *(gap for _, gap in solved))
        self.solved += len(weights)
        self.nonzero += int(np.count_nonzero(weights))
        jobs = [(group, weights[group.part]) for group in groups]
        rows = yield from self.clock("reconstruction", self._each(jobs, self._combine))
        return np.concatenate(rows), seen, wanted

    def _each(self, jobs, work):
        """The results of `work` for all jobs, in their order, on all cores."""

        def together(batch):
            with one_blas_thread():
                return on_all_cores(work, batch)

        step = 8 if self.paced else max(len(jobs), 1)
        results = []
        for first in range(0, len(jobs), step):
            batch = jobs[first : first + step]
            results += together(batch)
            yield Progress("sparse", len(results), len(jobs))
        return results

    def _columns(self, group):
        """Directions to trace for each point of a group, (n, m), and which of them are real."""
        settings, n_directions = self.settings, self.cube_map.n_directions
        above = unpack(group.above, n_directions, np.uint8).view(bool)
        if settings.reconstruction == "full":
            return np.broadcast_to(np.arange(n_directions), above.shape), above
        if settings.columns != "features":
            chosen = self._fixed_columns(group)
            return np.broadcast_to(chosen, (len(above), len(chosen))), above[:, chosen]
        varying = group.varying
        features = unpack(self.dense.rows.features[group.used], n_directions, np.uint8)
        features = features[:, varying].astype(np.float32)
        weights = feature_weights(self._transport(group, varying), features, group.local)
        places, valid = best_columns(weights, above[:, varying], settings.features)
        return varying[places], valid

    def _fixed_columns(self, group):
        """The same columns for all points of an object, as the rivals choose them."""
        index = int(self.scene.points.object_index[group.points[0]])
        if index not in self._fixed:
            rng = generator(self.settings.seed, Stage.SPARSE_RAYS, index)
            mine = np.flatnonzero(self.scene.points.object_index[self.dense.points] == index)
            mine = rng.choice(mine, min(len(mine), self.settings.reduced_rows), replace=False)
            rows = unpack(self.dense.rows.bits[mine], self.cube_map.n_directions)
            rows *= self._weight(self.dense.points[mine], slice(None))
            choice = COLUMN_CHOICES[self.settings.columns]
            self._fixed[index] = choice(rows, self.settings.features, rng)
        return self._fixed[index]

    def _wanted(self, group, columns, valid):
        wanted = np.zeros((len(columns), self.cube_map.n_directions), bool)
        row, column = np.nonzero(valid)
        wanted[row, columns[row, column]] = True
        return np.packbits(wanted, axis=1, bitorder="little")

    def _problems(self, job):
        """Gram matrices, moments and squares (see `gram`) of the points of a group."""
        group, seen, columns, valid = job
        needed = np.zeros(self.cube_map.n_directions, bool)
        needed[columns[valid]] = True
        place = np.cumsum(needed) - 1
        needed = np.flatnonzero(needed)
        local = np.where(valid, place[columns], 0)
        # A row of zeros stands for the neighbours that are not there.
        rows = np.zeros((len(group.used) + 1, max(len(needed), 1)), np.float32)
        rows[:-1, : len(needed)] = self._transport(group, needed)
        picked = rows[group.local[:, :, None], local[:, None, :]]
        own = self._own(group.points, columns) * valid
        seen = unpack(seen, self.cube_map.n_directions, np.uint8)
        target = own * np.take_along_axis(seen, columns, axis=1)
        picked *= own[:, None] if self.settings.quantity == "visibility" else valid[:, None]
        return gram(picked, target)

    def _combine(self, job):
        """Bits of the points of a group, (n, n_bytes): combinations of their neighbours' rows.

        Where a point's own neighbours agree their value is taken: a combination found from the
        directions that tell them apart says nothing of the others, and without any it is zero.
        """
        group, weights = job
        spread = np.zeros((len(weights), len(group.used) + 1), np.float32)
        np.add.at(spread, (np.arange(len(weights))[:, None], group.local), weights)
        limit, sign = np.float32(self.settings.threshold), 1
        if self.settings.quantity == "transport":
            whole = self._weight(group.points, group.varying)
            if self.factor is not None:
                # A term is seen where the combination is of its sign, and large enough.
                whole, sign = np.abs(whole), np.sign(whole)
            limit = limit * whole
        rows = self._transport(group, group.varying)
        seen_by = membership(group.local, len(rows)) @ (rows != 0).astype(np.float32)
        above_limit = (spread[:, :-1] @ rows) * sign > limit
        filled = np.empty((len(weights), self.cube_map.n_directions), bool)
        filled[:] = group.agreed
        filled[:, group.varying] = (seen_by > _ALL) | ((seen_by > 1 - _ALL) & above_limit)
        return np.packbits(filled, axis=1, bitorder="little") & group.above

    def _transport(self, group, directions):
        """(n_used, n) float32: what is combined, of the dense points of a group."""
        seen = unpack(self.dense.rows.bits[group.used], self.cube_map.n_directions, np.uint8)
        seen = seen[:, directions].astype(np.float32)
        if self.settings.quantity == "transport":
            seen *= self._weight(self.dense.points[group.used], directions)
        return seen

    def _own(self, points, columns):
        """(n, m): what is transported where all is seen, of columns of each point."""
        if self.factor is not None:
            return self.factor(points, columns)
        return np.einsum("nx,nmx->nm", self.scene.points.normals[points], self.vectors.T[columns])

    def _weight(self, points, directions):
        if self.factor is not None:
            return self.factor(points, directions)
        return np.maximum(self.scene.points.normals[points] @ self.vectors[:, directions], 0)

    def _solve(self, problems):
        """(n, k) float32 weights of the neighbours, and the largest gap as a share of |y|^2."""
        grams, moments, squares = problems
        if self.settings.reconstruction != "l1":
            return least_squares(grams, moments)[0].astype(np.float32), 0.0
        # Where nothing is seen the solution is zero for every lambda.
        strengths = self.settings.strength * np.abs(moments).max(axis=1, initial=0)
        solution = l1_batched(grams, moments, squares, np.maximum(strengths, 1e-30))
        share = solution.gap / np.maximum(squares, 1e-30)
        return solution.weights.astype(np.float32), float(share.max(initial=0))


class _Group:
    """Points that lie side by side.

    Attributes
    ----------
    part : slice
        Of the block.
    points : (n,), above : (n, n_bytes)
    used : (n_used,) int64
        Places of all their neighbours in the dense points.
    local : (n, k) int64
        Neighbours among `used`; -1, the last of a padded array, where there are fewer.
    varying : (n_varying,) int64
        Directions about which the neighbours disagree.
    agreed : (n_directions,) bool
        What they say of the others.
    """

    def __init__(self, part, points, neighbours, above, dense):
        self.part, self.points, self.above = part, points[part], above[part]
        near = neighbours[part]
        self.used, local = np.unique(near, return_inverse=True)
        self.local = local.reshape(near.shape)
        if self.used[0] < 0:
            self.used, self.local = self.used[1:], self.local - 1
        rows = dense.rows.bits[self.used]
        every, extremes = np.bitwise_and.reduce(rows, axis=0), np.bitwise_or.reduce(rows, axis=0)
        self.varying = np.flatnonzero(np.unpackbits(every ^ extremes, bitorder="little"))
        self.agreed = np.unpackbits(every, bitorder="little").view(bool)
