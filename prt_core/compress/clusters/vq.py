"""Vector quantisation: every row is replaced by the mean of its cluster."""

from prt_core.compress.clusters.clusters import ClusterCompressor
from prt_core.compress.clusters.kmeans import kmeans_steps
from prt_core.compress.clusters.sketch import sketch_steps
from prt_core.errors import expect_seed, expect_whole


class VectorQuantisation(ClusterCompressor):
    """k-means; the code book is the means.

    Parameters
    ----------
    n_clusters : int
    n_sketch : int
        Coordinates in which rows are clustered (see `sketch_steps`).
    seed : int
    """

    def __init__(self, n_clusters=1024, n_sketch=64, seed=0):
        self.n_clusters = n_clusters
        self.n_sketch = n_sketch
        self.seed = seed

    def expect_params(self):
        expect_whole("n_clusters", self.n_clusters, 1)
        expect_whole("n_sketch", self.n_sketch, 1)
        expect_seed(self.seed)
        return self

    def fit_steps(self, rows):
        self.expect_params()
        sketch = yield from sketch_steps(rows, self.n_sketch, self.seed)
        labels = yield from kmeans_steps(sketch.coordinates, self.n_clusters, self.seed)
        return (yield from self._fit_clusters(rows, labels, 0))
