"""Principal component analysis of the whole matrix, and of its blocks."""

import numpy as np

from prt_core.compress.clusters.clusters import ClusterCompressor, expect_tolerance
from prt_core.errors import expect, expect_array, expect_pair, expect_whole


class PCA(ClusterCompressor):
    """The truncated SVD of all rows about their mean.

    Light transport is not globally of low rank: the yardstick for the local methods.

    Parameters
    ----------
    n_components : int
    tolerance : float, optional
        Relative L2 of the matrix: fewer components where they suffice.
    """

    def __init__(self, n_components=24, tolerance=None):
        self.n_components = n_components
        self.tolerance = tolerance

    def expect_params(self):
        expect_whole("n_components", self.n_components, 0)
        expect_tolerance(self.tolerance)
        return self

    def fit_steps(self, rows):
        self.expect_params()
        labels = np.zeros(rows.n_points, np.int32)
        return self._fit_clusters(rows, labels, self.n_components, self.tolerance)


class BlockPCA(ClusterCompressor):
    """PCA of square blocks of an image's points (Krivanek 2011, after Nayar et al. 2004).

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of the image whose pixels the points are, in reading order.
    size : int
        Pixels along a block's edge.
    n_components : int
    tolerance : float, optional
        Relative L2 of the matrix.
    pixels : (n_points,) int, optional
        Which of them the points are, where they are not all.
    """

    def __init__(self, shape, size=16, n_components=24, tolerance=None, pixels=None):
        self.shape = shape
        self.pixels = pixels
        self.size = size
        self.n_components = n_components
        self.tolerance = tolerance

    def expect_params(self):
        expect_whole("size", self.size, 1)
        expect_whole("n_components", self.n_components, 0)
        expect_tolerance(self.tolerance)
        return self

    def fit_steps(self, rows):
        self.expect_params()
        (height, width), size = expect_pair("shape", self.shape), self.size
        n_points, pixels = rows.n_points, self.pixels
        if pixels is None:
            expect(
                height * width == n_points,
                f"shape: {height} x {width} pixels are not the {n_points} points of the rows",
            )
            pixels = np.arange(n_points)
        pixels = expect_array("pixels", pixels, (n_points,), np.int64, 0, height * width - 1)
        row, column = np.divmod(pixels, width)
        labels = row // size * -(-width // size) + column // size
        # Blocks without any of the pixels are none.
        _, labels = np.unique(labels, return_inverse=True)
        return self._fit_clusters(rows, labels, self.n_components, self.tolerance)
