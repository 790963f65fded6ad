"""Clusters by projected distance: planted spaces that cross, and distances by plain loops."""

import numpy as np
import pytest

from prt_core.compress import ClusteredPCA, SparseClusteredPCA
from prt_core.compress.clusters.kmeans import kmeans_steps
from prt_core.compress.clusters.lbg import assign, lbg_steps
from prt_core.runtime.progress import run


def crossing(seed, n_clusters, n_each, rank, n_directions, decay=1.0):
    """Rows of affine spaces that cross near one place, so that no mean tells them apart."""
    rng = np.random.default_rng(seed)
    labels = np.arange(n_clusters * n_each) % n_clusters
    bases = np.linalg.qr(rng.standard_normal((n_directions, n_clusters * rank)))[0].T
    bases = bases.reshape(n_clusters, rank, n_directions)
    means = 0.3 * rng.standard_normal((n_clusters, n_directions))
    weights = 3 * rng.standard_normal((len(labels), rank)) * decay ** np.arange(rank)
    rows = means[labels] + np.einsum("nk,nkd->nd", weights, bases[labels])
    return (rows + 0.02 * rng.standard_normal(rows.shape)).astype(np.float32)


def left_over(rows, labels, rank):
    """Relative error of the best affine space of each cluster."""
    lost = 0.0
    for label in np.unique(labels):
        mine = rows[labels == label].astype(np.float64)
        lost += (np.linalg.svd(mine - mine.mean(axis=0), compute_uv=False)[rank:] ** 2).sum()
    return np.sqrt(lost / (rows.astype(np.float64) ** 2).sum())


def test_each_row_goes_to_the_affine_space_that_is_nearest():
    rng = np.random.default_rng(1)
    rows = rng.standard_normal((1100, 7)).astype(np.float32)
    models = []
    for rank in (2, 0, None, 1, 3):
        if rank is None:
            models.append(None)
            continue
        basis = np.linalg.qr(rng.standard_normal((7, 3)))[0].T[:rank]
        models.append(((0.7 * rng.standard_normal(7)).astype(np.float32), np.float32(basis)))
    labels, distances = assign(rows, models)
    for row, label, distance in zip(rows[::11], labels[::11], distances[::11], strict=True):
        squares = []
        for model in models:
            if model is None:
                squares.append(np.inf)
                continue
            rest = row.astype(np.float64) - model[0]
            for along in model[1].astype(np.float64):
                rest = rest - (rest @ along) * along
            squares.append(rest @ rest)
        assert label == np.argmin(squares)
        assert distance == pytest.approx(min(squares), abs=1e-4)
    assert len(np.unique(labels)) == 4 and 2 not in labels


def test_rows_that_two_clusters_hold_exactly_stay_where_they_are():
    """So that none loses all of its rows to rounding, and is no more there for others."""
    rows = (1e3 * np.random.default_rng(2).standard_normal((8, 12))).astype(np.float32)
    labels = np.arange(8, dtype=np.int32) % 2
    inside = np.linalg.qr(rows.T)[0].T.astype(np.float32)
    models = [(rows[label], inside) for label in (0, 1)]
    np.testing.assert_array_equal(assign(rows, models, labels)[0], labels)
    np.testing.assert_array_equal(assign(rows, models, 1 - labels)[0], 1 - labels)
    moved = [(rows[0], inside[:3]), (rows[1], inside)]
    assert (assign(rows, moved, 0 * labels)[0][3:] == 1).all()


def test_spaces_that_cross_are_found_by_projected_distance_alone():
    errors = []
    for seed in range(6):
        rows = crossing(seed, 4, 30, 2, 24)
        models = [ClusteredPCA(4, 2, method=m).fit(rows) for m in ("static", "iterative")]
        errors.append([model.matrix_error_ for model in models])
    static, iterative = np.transpose(errors)
    assert (static > 0.4).all() and (iterative < 0.95 * static).all()
    # Down to the noise, but where the first clusters lead into another minimum.
    assert (iterative < 0.03).sum() >= 4


def test_components_that_come_one_by_one_pass_local_minima():
    # Eight rows of five dimensions fit any clusters: with all components at once none moves.
    errors = []
    for seed in range(12):
        rows = crossing(seed, 8, 8, 5, 64, 0.6)
        first = run(kmeans_steps(rows, 8, seed))
        slow = run(lbg_steps(rows, first, 5))
        quick = run(lbg_steps(rows, first, 5, ranks=[5], last_rounds=12))
        errors.append([left_over(rows, labels, 5) for labels in (slow, quick)])
    slow, quick = np.mean(errors, axis=0)
    assert slow < 0.92 * quick
    assert (np.diff(errors, axis=1) > -0.02).all()


def test_refined_clusters_are_never_further_off():
    for rank, seed in ((0, 0), (1, 1), (2, 2)):
        rows = crossing(seed, 3, 40, 2, 24)
        first = run(kmeans_steps(rows, 3, seed))
        refined = run(lbg_steps(rows, first, rank))
        assert left_over(rows, refined, rank) <= left_over(rows, first, rank) + 1e-6


def test_sparse_points_find_their_space_whatever_their_neighbours_say():
    # The neighbours are anyone: what they say is put right by the assignment of all rows.
    for seed in (0, 1):
        rows = crossing(seed, 3, 40, 2, 24)
        rng = np.random.default_rng(seed)
        dense = np.arange(60)
        near = rng.integers(0, 60, (120, 3))
        result = SparseClusteredPCA(dense, near, 3, 2).fit(rows)
        full = ClusteredPCA(3, 2, method="iterative").fit(rows[dense])
        assert result.matrix_error_ < 1.5 * full.matrix_error_
