import numpy as np
import pytest
from scipy.spatial import cKDTree
from sklearn.base import clone

from prt_core import PRTError
from prt_core.compress import (
    PCA,
    ArrayRows,
    BlockPCA,
    ClusteredPCA,
    ClusterEvaluator,
    SparseClusteredPCA,
    TransportRows,
    VectorQuantisation,
    border_pairs,
    neighbour_pairs,
    seam,
)
from prt_core.compress.clusters import affine as affine_module
from tests.core.compress.conftest import relative

RNG = np.random.default_rng(3)
KINDS = [
    PCA(5),
    VectorQuantisation(7),
    ClusteredPCA(4, 3),
    ClusteredPCA(4, 3, method="iterative"),
    BlockPCA((6, 10), 4, 3),
]


def planted(n_clusters=3, n=60, rank=2, n_directions=24):
    """Rows that lie exactly in affine spaces of few dimensions, far from each other."""
    labels = np.arange(n) % n_clusters
    means = 20 * RNG.standard_normal((n_clusters, n_directions))
    bases = RNG.standard_normal((n_clusters, rank, n_directions))
    weights = RNG.standard_normal((n, rank))
    return means[labels] + np.einsum("nk,nkd->nd", weights, bases[labels]), labels


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: f"{type(k).__name__} {k.__dict__}"[:60])
def test_estimator_conventions(kind):
    rows = RNG.standard_normal((60, 24, 2))
    model = clone(kind).fit(rows)
    assert model.get_params() == kind.get_params()
    result = model.inverse_transform(model.transform(rows))
    stored = model.reconstruct(np.arange(60))
    assert result.shape == stored.shape == rows.shape
    # Assigning anew by the projected distance can only come nearer.
    assert relative(result, rows) <= relative(stored, rows) + 1e-6
    assert relative(stored, rows) == pytest.approx(model.matrix_error_, abs=1e-4)
    assert model.nbytes > 0
    with pytest.raises(PRTError, match="fit"):
        clone(kind).product(np.zeros((24, 2)))
    with pytest.raises(PRTError, match="light"):
        model.product(np.zeros((23, 2)))
    with pytest.raises(PRTError, match="NaN"):
        model.product(np.full((24, 2), np.nan))


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: type(k).__name__)
def test_relighting_is_linear_and_that_of_the_rows(kind):
    rows = RNG.standard_normal((60, 24, 2))
    model = clone(kind).fit(rows)
    a, b = RNG.standard_normal((2, 24, 2)).astype(np.float32)
    truth = np.einsum("ndc,dc->nc", model.reconstruct(np.arange(60)), a)
    np.testing.assert_allclose(model.product(a), truth, atol=1e-4)
    np.testing.assert_allclose(
        model.product(2 * a - b), 2 * model.product(a) - model.product(b), atol=1e-3
    )


@pytest.mark.parametrize("method", ["static", "iterative"])
def test_planted_spaces_are_found(method):
    rows, labels = planted()
    model = ClusteredPCA(3, 2, method=method).fit(rows)
    # The root of a difference of float32 sums.
    assert model.matrix_error_ < 1e-4
    assert relative(model.reconstruct(np.arange(60))[..., 0], rows) < 1e-5
    # The same clusters, whatever their names.
    assert len({(a, b) for a, b in zip(model.labels_, labels, strict=True)}) == 3


def test_full_rank_is_exact():
    rows = RNG.standard_normal((20, 12, 1))
    assert relative(PCA(19).fit(rows).reconstruct(np.arange(20)), rows) < 1e-5
    assert relative(ClusteredPCA(20, 0).fit(rows).reconstruct(np.arange(20)), rows) < 1e-5


def test_more_components_are_never_worse():
    rows = RNG.standard_normal((80, 24))
    errors = [ClusteredPCA(4, k).fit(rows).matrix_error_ for k in (0, 1, 3, 8)]
    assert errors == sorted(errors, reverse=True) and errors[-1] < errors[0]


@pytest.mark.parametrize("tolerance", [0.5, 0.1, 0.01])
def test_tolerance_is_kept_with_as_few_components_as_it_needs(tolerance):
    rows = RNG.standard_normal((90, 24)) * 0.5 ** np.arange(24)
    model = ClusteredPCA(3, 24, tolerance=tolerance).fit(rows)
    assert model.matrix_error_ <= tolerance
    fewer = ClusteredPCA(3, 24, tolerance=min(tolerance * 2, 0.99)).fit(rows)
    assert fewer.ranks_.sum() <= model.ranks_.sum()
    worst = min(a.energies[-1] for a in model.affine_ if len(a.energies))
    total = (rows.astype(np.float32) ** 2).sum()
    assert model.matrix_error_**2 + worst / total > tolerance**2


@pytest.mark.parametrize("method", ["static", "iterative"])
def test_ugly_rows(method):
    rows = np.zeros((50, 24), np.float32)
    model = ClusteredPCA(6, 3, method=method).fit(rows)
    assert model.matrix_error_ == 0 and model.ranks_.sum() == 0
    assert not model.product(np.ones(24)).any()
    rows[:] = RNG.random(24)
    model = ClusteredPCA(6, 3, method=method).fit(rows)
    assert model.ranks_.sum() == 0 and model.matrix_error_ < 1e-6
    one_hot = np.eye(24, dtype=np.float32)[np.arange(50) % 24]
    model = ClusteredPCA(24, 2, method=method).fit(one_hot)
    # As many clusters as different rows; those that k-means left empty are gone.
    assert len(model.affine_) <= 24 and np.bincount(model.labels_).min() > 0
    assert model.matrix_error_ < 0.6
    bright = 1e5 * RNG.random((40, 24)).astype(np.float32)
    model = ClusteredPCA(2, 24, method=method).fit(bright)
    assert relative(model.reconstruct(np.arange(40))[..., 0], bright) < 1e-5


def test_blocks_agree_with_one_piece(monkeypatch):
    rows = ArrayRows(RNG.standard_normal((1500, 24)) * 0.6 ** np.arange(24))
    whole = affine_module.fit_affine(rows, np.arange(1500), 5)
    monkeypatch.setattr(affine_module, "MOST_ROWS", 100)
    blocked = affine_module.fit_affine(rows, np.arange(1500), 5)
    np.testing.assert_allclose(blocked.energies, whole.energies, rtol=1e-3)
    np.testing.assert_allclose(blocked.mean, whole.mean, atol=1e-5)
    assert blocked.energy == pytest.approx(whole.energy, rel=1e-5)
    np.testing.assert_allclose(blocked.basis @ blocked.basis.T, np.eye(5), atol=1e-5)


def test_the_same_seed_gives_the_same_bytes(transport):
    a, b = (ClusteredPCA(5, 4, seed=3).fit(TransportRows(transport, 20)) for _ in range(2))
    np.testing.assert_array_equal(a.labels_, b.labels_)
    for x, y in zip(a.affine_, b.affine_, strict=True):
        np.testing.assert_array_equal(x.weights, y.weights)


def test_image_blocks_are_squares():
    model = BlockPCA((5, 7), 3, 1).fit(RNG.standard_normal((35, 6)))
    assert len(model.affine_) == 2 * 3
    image = model.labels_.reshape(5, 7)
    assert (image[:3, :3] == image[0, 0]).all() and image[3, 0] != image[2, 0]
    with pytest.raises(PRTError, match="shape"):
        BlockPCA((5, 6)).fit(np.zeros((35, 6)))


@pytest.fixture(scope="module")
def compressed(transport):
    return ClusteredPCA(8, 12).fit(TransportRows(transport, 80))


def test_real_time_relighting_is_that_of_the_model(transport, compressed, light):
    quick = ClusterEvaluator(compressed, n_terms=None, error=0)
    assert relative(quick.product(light), compressed.product(light)) < 1e-5
    again = light[::-1].copy()
    assert relative(quick.product(again), compressed.product(again)) < 1e-5
    assert not quick.product(np.zeros_like(light)).any()


def test_bright_texels_are_exact(transport, compressed, light):
    truth = transport.product(light)
    plain = relative(ClusterEvaluator(compressed).product(light), truth)
    exact = relative(ClusterEvaluator(compressed, transport).product(light), truth)
    assert exact < 0.5 * plain
    sun = np.zeros_like(light)
    sun[100] = 1e5
    direct_only = TransportRows(transport, 0)
    model = ClusteredPCA(2, 0).fit(direct_only)
    result = ClusterEvaluator(model, transport).product(sun)
    assert relative(result, transport.product(sun, bounces=0)) < 1e-5


def test_fewer_terms_cost_what_was_asked_for(transport, compressed, light):
    light = light.copy()
    light[100] = 1
    every = ClusterEvaluator(compressed, n_terms=None, error=0).product(light)
    errors = []
    for error in (0.1, 0.01, 0.001):
        quick = ClusterEvaluator(compressed, n_terms=None, error=error)
        assert quick.terms(light)[0] < transport.n_directions
        errors.append(relative(quick.product(light), every))
        assert errors[-1] < 3 * error
    assert errors == sorted(errors, reverse=True)


def test_another_transport_is_refused(transport, compressed):
    from dataclasses import replace

    parts = {name: getattr(transport, name)[:-1] for name in ("bits", "normals", "materials")}
    other = replace(transport, gather=None, **parts)
    with pytest.raises(PRTError, match="transport"):
        ClusterEvaluator(compressed, other)


def test_blended_borders_have_smaller_seams(scene, transport, light):
    rows = TransportRows(transport, 40)
    model = ClusteredPCA(6, 2).fit(rows)
    points = scene.points
    pairs = neighbour_pairs(points.positions, points.normals, points.object_index)
    border = border_pairs(model.labels_, pairs)
    assert 0 < len(border) < len(pairs)
    light = np.minimum(light, 5)
    truth = transport.product(light)
    before = seam(model.product(light), truth, border)
    error = relative(model.product(light), truth)
    model.blend_borders(rows, pairs)
    after = seam(model.product(light), truth, border)
    assert after["rms"] < 0.85 * before["rms"]
    assert relative(model.product(light), truth) < error
    quick = ClusterEvaluator(model, n_terms=None, error=0)
    assert relative(quick.product(light), model.product(light)) < 1e-5
    every = np.arange(rows.n_points)
    truth = np.einsum("ndc,dc->nc", model.reconstruct(every), light)
    assert relative(model.product(light), truth) < 1e-5
    with pytest.raises(PRTError, match="already"):
        model.blend_borders(rows, pairs)


def test_without_borders_there_is_no_seam():
    labels, pairs = np.zeros(4, int), np.array([[0, 1], [2, 3]])
    assert len(border_pairs(labels, pairs)) == 0
    assert seam(np.ones((4, 3)), np.zeros((4, 3)), border_pairs(labels, pairs))["largest"] == 0
    result = seam(np.array([[0.0], [2], [0], [0]]), np.ones((4, 1)), pairs)
    assert result["largest"] == 2 and result["rms"] == pytest.approx(np.sqrt(2))


def test_dense_points_are_enough_for_the_clusters(scene, transport):
    rows = TransportRows(transport, 40)
    positions = scene.points.positions
    dense = np.arange(0, rows.n_points, 4)
    _, near = cKDTree(positions[dense]).query(positions, 4)
    full = ClusteredPCA(6, 6, method="iterative").fit(rows)
    sparse = SparseClusteredPCA(dense, dense[near], 6, 6).fit(rows)
    assert sparse.matrix_error_ < 1.15 * full.matrix_error_
    with pytest.raises(PRTError, match="neighbours"):
        SparseClusteredPCA(dense, near * 4 + 1, 6, 6).fit(rows)
    with pytest.raises(PRTError, match="dense"):
        SparseClusteredPCA([], dense[near], 6, 6).fit(rows)
