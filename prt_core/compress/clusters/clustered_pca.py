"""Clustered principal component analysis (Sloan et al. 2003)."""

import numpy as np

from prt_core.compress.clusters.clusters import ClusterCompressor, expect_tolerance
from prt_core.compress.clusters.kmeans import kmeans_steps
from prt_core.compress.clusters.lbg import lbg_steps
from prt_core.compress.clusters.sketch import sketch_steps
from prt_core.compress.parameters import expect_optional
from prt_core.errors import expect_one_of, expect_seed, expect_whole

# Points a cluster has on average where their number is not given.
_POINTS_A_CLUSTER = 350


class ClusteredPCA(ClusterCompressor):
    """Clusters of points whose rows lie near an affine space of few dimensions.

    Parameters
    ----------
    n_clusters : int, optional
        Default: one for every 350 points.
    n_components : int
        At most so many a cluster.
    method : {"static", "iterative"}
        Cluster about means and find components once; or assign by the projected distance,
        with components added one by one (Sloan et al. 2003, section 5).
    tolerance : float, optional
        Relative L2 of the matrix: each cluster gets the components that this needs.
    n_sketch : int
        Coordinates in which rows are clustered (see `sketch_steps`).
    seed : int
    """

    def __init__(
        self,
        n_clusters=None,
        n_components=24,
        method="static",
        tolerance=None,
        n_sketch=None,
        seed=0,
    ):
        self.n_clusters = n_clusters
        self.n_components = n_components
        self.method = method
        self.tolerance = tolerance
        self.n_sketch = n_sketch
        self.seed = seed

    def expect_params(self):
        expect_optional("n_clusters", self.n_clusters, 1)
        expect_whole("n_components", self.n_components, 0)
        expect_optional("n_sketch", self.n_sketch, 1)
        expect_tolerance(self.tolerance)
        expect_one_of("method", self.method, ("static", "iterative"))
        expect_seed(self.seed)
        return self

    def fit_steps(self, rows):
        self.expect_params()
        n_clusters, rank, tolerance = self.n_clusters, self.n_components, self.tolerance
        if n_clusters is None:
            n_clusters = max(1, round(rows.n_points / _POINTS_A_CLUSTER))
        iterative = self.method == "iterative"
        n_sketch = self.n_sketch or (256 if iterative else 64)
        sketch = yield from sketch_steps(rows, n_sketch, self.seed)
        first = np.ascontiguousarray(sketch.coordinates[:, :64])
        labels = yield from kmeans_steps(first, n_clusters, self.seed)
        if iterative:
            labels = yield from lbg_steps(sketch.coordinates, labels, rank)
        return (yield from self._fit_clusters(rows, labels, rank, tolerance))
