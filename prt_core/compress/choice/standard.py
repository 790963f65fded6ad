"""The methods of this library by name, each with its budgets from small to near."""

import numpy as np
from scipy.spatial import cKDTree

from prt_core.basis import WAVELETS, ImageWavelet, PointHaar, PointMultiwavelet
from prt_core.compress.choice.methods import Method, register_method
from prt_core.compress.clusters.clustered_pca import ClusteredPCA
from prt_core.compress.clusters.pca import PCA, BlockPCA
from prt_core.compress.clusters.realtime import ClusterEvaluator
from prt_core.compress.clusters.seams import neighbour_pairs
from prt_core.compress.clusters.sparse_clusters import SparseClusteredPCA
from prt_core.compress.clusters.vq import VectorQuantisation
from prt_core.compress.harmonics import Harmonics, Irradiance
from prt_core.compress.wavelets.haar_lighting import HaarLighting
from prt_core.compress.wavelets.wavelet4d import Wavelet4D
from prt_core.errors import expect

# Components, and points a cluster has on average: 24 components of 1,000 points are nearer, smaller
# and faster than 12 to 16 components of 400.
_CLUSTERED = ((2, 1000), (4, 700), (8, 500), (24, 1000), (24, 350), (40, 300), (64, 250))
_COMPONENTS = (8, 16, 32, 64, 96, 128, 192, 256)
_POINTS_A_VECTOR = (120, 30, 10)
# Terms of the light, and the quantisation step.
_HAAR = ((32, 1 / 64), (256, 1 / 254), (2048, 1 / 1022))
_ORDERS = (3, 5, 10)
# Of an image: pixels along a block's edge, and components.
_BLOCKS = ((16, 4), (16, 8), (16, 16), (8, 16), (8, 24))
# Transforms of columns on points, and that of an image where none is asked for.
_ON_POINTS = {"multiwavelet": PointMultiwavelet, "haar": PointHaar}
_ON_IMAGES = "9/7"
# Dense points near a point that say which cluster it is in at first.
_NEIGHBOURS = 12
# Terms that a light is cut to when clusters are relit, at most.
_TERMS = 512
# Error of the matrix, and bits of a coefficient.
_WAVELETS = ((0.3, 7), (0.2, 7), (0.1, 7), (0.05, 7), (0.02, 8), (0.01, 9), (0.005, 9))


def _clustered(task):
    return [
        ClusteredPCA(max(1, round(task.n_points / points)), components, seed=task.seed)
        for components, points in _CLUSTERED
    ]


def _from_dense(task):
    expect(
        task.dense is not None and len(task.dense),
        "method: 'sparse_cpca' begins with densely sampled points; bake with --method huang",
    )
    near = _dense_neighbours(task)
    return [
        SparseClusteredPCA(
            task.dense, near, max(1, round(task.n_points / points)), components, seed=task.seed
        )
        for components, points in _CLUSTERED
    ]


def _dense_neighbours(task):
    """(n_points, k) int64: for each point the nearest dense points of its object, or of all."""
    near = np.full((task.n_points, _NEIGHBOURS), -1)
    for group in np.unique(task.groups):
        mine = np.flatnonzero(task.groups == group)
        known = task.dense[task.groups[task.dense] == group]
        known = known if len(known) else task.dense
        k = min(_NEIGHBOURS, len(known))
        _, nearest = cKDTree(task.positions[known]).query(task.positions[mine], range(1, k + 1))
        near[mine, :k] = known[nearest]
    return near


def _vectors(task):
    return [
        VectorQuantisation(max(1, round(task.n_points / points)), seed=task.seed)
        for points in _POINTS_A_VECTOR
    ]


def _wavelets(task):
    columns = _columns(task, "columns", "multiwavelet" if task.image is None else _ON_IMAGES)
    return [Wavelet4D(columns, error=error, bits=bits, seed=task.seed) for error, bits in _WAVELETS]


def _never(_):
    return False


def _is_image(task):
    return task.image is not None


def _columns(task, _, word):
    known = _ON_POINTS if task.image is None else WAVELETS
    expect(
        word in known,
        f"method: 'wavelet4d': columns: expected one of {', '.join(known)} for "
        f"{'points' if task.image is None else 'an image'}, got '{word}'",
    )
    if task.image is None:
        return _ON_POINTS[word](task.positions, task.normals, task.groups)
    # Some of an image's pixels are no image; patches of them are squares of the tree of points.
    if not _is_whole(task):
        return PointMultiwavelet(task.positions, task.normals, task.groups)
    return ImageWavelet((task.image.height, task.image.width), word)


def _irradiance(task):
    expect(
        task.image is None,
        "method: 'irradiance' takes points, whose normals it needs; ask for --of points",
    )
    return [Irradiance()]


def _blocks(task):
    expect(
        task.image is not None,
        "method: 'block_pca' takes the pixels of an image; bake with --camera-pixels or "
        "--geometry-image",
    )
    shape, pixels = (task.image.height, task.image.width), None
    if not _is_whole(task):
        column, row, _ = task.positions.astype(np.int64).T
        pixels = row * task.image.width + column
    return [BlockPCA(shape, size, n_components, pixels=pixels) for size, n_components in _BLOCKS]


def _is_whole(task):
    """Whether the points are all pixels of the image, and not some that a choice is tried on."""
    return task.n_points == task.image.height * task.image.width


def _clusters_work(model, n_points):
    """Weights of each point, and the terms that each row of the bases is read at."""
    return (_weights(model) + _TERMS * _basis_rows(model)) * n_points / model.n_points_


def _one_basis_work(model, n_points):
    return _weights(model) * n_points / model.n_points_ + _TERMS * _basis_rows(model)


def _weights(model):
    return sum(a.weights.size for a in model.affine_) + model.n_points_


def _basis_rows(model):
    return sum(1 + len(a.basis) for a in model.affine_)


def _one_basis(model, n_points):
    """The mean and the basis are there once, the weights for each point."""
    basis = sum(a.mean.nbytes + a.basis.nbytes for a in model.affine_)
    each = (model.nbytes - basis) / model.n_points_
    return basis + each * n_points


def _blend(model, task):
    pairs = neighbour_pairs(task.positions, task.normals, task.groups)
    model.blend_borders(task.rows, pairs)


register_method(
    Method("cpca", ClusteredPCA, _clustered, ClusterEvaluator, _blend, work=_clusters_work)
)
register_method(
    Method(
        "pca",
        PCA,
        lambda task: [PCA(n) for n in _COMPONENTS],
        ClusterEvaluator,
        local=False,
        size=_one_basis,
        work=_one_basis_work,
    )
)
register_method(Method("vq", VectorQuantisation, _vectors, ClusterEvaluator, work=_clusters_work))
register_method(
    Method(
        "haar",
        HaarLighting,
        lambda task: [HaarLighting(terms, step=step) for terms, step in _HAAR],
        local=False,
        first=_never,
    )
)
register_method(
    Method(
        "wavelet4d",
        Wavelet4D,
        _wavelets,
        first=_is_image,
        choices={"columns": tuple(dict.fromkeys((*_ON_POINTS, *WAVELETS)))},
        make=_columns,
    )
)
register_method(
    Method(
        "harmonics",
        Harmonics,
        lambda task: [Harmonics(order) for order in _ORDERS],
        local=False,
    )
)
register_method(Method("irradiance", Irradiance, _irradiance, local=False, candidate=False))
register_method(
    Method(
        "block_pca",
        BlockPCA,
        _blocks,
        ClusterEvaluator,
        work=_clusters_work,
        candidate=False,
        fixed=("shape", "pixels"),
    )
)
register_method(
    Method(
        "sparse_cpca",
        SparseClusteredPCA,
        _from_dense,
        ClusterEvaluator,
        _blend,
        work=_clusters_work,
        candidate=False,
        fixed=("dense", "neighbours", "seed"),
    )
)
