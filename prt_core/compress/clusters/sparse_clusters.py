"""Clustered PCA of a sparse bake (Huang & Ramamoorthi 2010, section 6)."""

import numpy as np

from prt_core.compress.clusters.clusters import ClusterCompressor, expect_tolerance
from prt_core.compress.clusters.kmeans import kmeans_steps
from prt_core.compress.clusters.lbg import lbg_steps
from prt_core.compress.clusters.sketch import Sketch, sketch_basis, sketch_coordinates
from prt_core.compress.parameters import expect_optional
from prt_core.errors import expect, expect_array, expect_seed, expect_whole

# Components that clusters of dense points go through; rounds of all rows in the end.
_RANKS, _LAST = (1, 2, 3, 4, 6, 8, 12, 16, 20, 24, 32, 48, 64), 4


class SparseClusteredPCA(ClusterCompressor):
    """Clusters found on densely sampled points; the others follow their neighbours.

    Rows of sparse points are combinations of those of dense points nearby, so clusters and
    components of the dense points serve them. One assignment of all rows at the end, without
    new components, puts right what the neighbours could not know.

    Parameters
    ----------
    dense : (n_dense,) int
        The densely sampled points.
    neighbours : (n_points, k) int
        For each point dense points near it, nearest first; -1: none.
    n_clusters : int, optional
        Default: one for every 350 points.
    n_components : int
    tolerance : float, optional
        Relative L2 of the matrix.
    n_sketch, seed : int
        See `ClusteredPCA`.
    """

    def __init__(
        self,
        dense=None,
        neighbours=None,
        n_clusters=None,
        n_components=24,
        tolerance=None,
        n_sketch=192,
        seed=0,
    ):
        self.dense = dense
        self.neighbours = neighbours
        self.n_clusters = n_clusters
        self.n_components = n_components
        self.tolerance = tolerance
        self.n_sketch = n_sketch
        self.seed = seed

    def expect_params(self):
        expect_optional("n_clusters", self.n_clusters, 1)
        expect_whole("n_components", self.n_components, 0)
        expect_whole("n_sketch", self.n_sketch, 1)
        expect_tolerance(self.tolerance)
        expect_seed(self.seed)
        return self

    def fit_steps(self, rows):
        self.expect_params()
        last = rows.n_points - 1
        dense = expect_array("dense", self.dense, (None,), np.int64, 0, last)
        near = expect_array(
            "neighbours", self.neighbours, (rows.n_points, None), np.int64, -1, last
        )
        expect(len(dense), f"dense: expected some of the {rows.n_points} points, got none")
        known = np.zeros(rows.n_points + 1, bool)
        known[dense] = True
        expect(
            near.shape[1] and (near[:, 0] >= 0).all() and (known[near] | (near < 0)).all(),
            "neighbours: expected at least one for each point, and dense points only",
        )
        n_clusters = self.n_clusters
        if n_clusters is None:
            n_clusters = max(1, round(rows.n_points / 350))
        rank = self.n_components
        if hasattr(rows, "prepare_steps"):
            yield from rows.prepare_steps()
        basis = yield from sketch_basis(rows, dense, self.n_sketch, self.seed)
        dense_coordinates: Sketch = yield from sketch_coordinates(rows, basis, dense)
        labels = yield from kmeans_steps(
            dense_coordinates.coordinates[:, :64], n_clusters, self.seed
        )
        # Components several at a time: nearly as good as one by one, in fewer rounds.
        ranks = sorted({min(rank, k) for k in _RANKS} | {rank})
        labels = yield from lbg_steps(
            dense_coordinates.coordinates, labels, rank, rounds=2, ranks=ranks
        )
        everywhere = self._follow(labels, dense, near, rows.n_points)
        every = yield from sketch_coordinates(rows, basis, np.arange(rows.n_points))
        everywhere = yield from lbg_steps(
            every.coordinates, everywhere, rank, ranks=[rank], last_rounds=_LAST
        )
        return (yield from self._fit_clusters(rows, everywhere, rank, self.tolerance))

    def state(self):
        # What clusters were begun from is no part of what they came to be.
        state = super().state()
        begun = "dense", "neighbours"
        state["params"] = {k: v for k, v in state["params"].items() if k not in begun}
        return state

    @staticmethod
    def _follow(labels, dense, near, n_points):
        """Each point's cluster: that of most of its dense neighbours, the nearest among equals."""
        by_point = np.full(n_points + 1, -1, np.int32)
        by_point[dense] = labels
        votes = by_point[near]
        count = (votes[:, :, None] == votes[:, None, :]).sum(axis=2)
        count[votes < 0] = 0
        result = np.take_along_axis(votes, count.argmax(axis=1)[:, None], axis=1)[:, 0]
        result[dense] = labels
        return result
