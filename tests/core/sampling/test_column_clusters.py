"""Clusters of columns by Hašan's distance |a| |b| - a . b, on planted columns."""

import numpy as np
import pytest

from prt_core.sampling.rivals import hasan_columns


def planted(seed, n_kinds=6, n_each=9):
    """Columns of a few directions, each in sizes from 0.1 to 30."""
    rng = np.random.default_rng(seed)
    directions = np.linalg.qr(rng.standard_normal((12, n_kinds)))[0].T
    kind = np.repeat(np.arange(n_kinds), n_each)
    sizes = np.exp(rng.uniform(np.log(0.1), np.log(30), len(kind)))
    return (directions[kind] * sizes[:, None]).T.astype(np.float32), kind, sizes


@pytest.mark.parametrize("n_columns", [6, 9])
def test_columns_that_differ_in_size_alone_are_not_apart(n_columns):
    # Two thirds of the clusters come from sampled centres: with the distance as published no two
    # of these have one direction, and the others split what costs most.
    for seed in range(20):
        rows, kind, _ = planted(seed)
        chosen = hasan_columns(rows, n_columns, np.random.default_rng(seed))
        assert len(chosen) == n_columns
        assert len(set(kind[chosen])) == 6, seed


def test_splits_cut_where_it_pays_most():
    # Angles in three groups: three columns are one of each, wherever the first two centres fell.
    # The cluster that is cut has fewer columns than the other, which costs nothing.
    group = np.repeat([0, 1, 2], [4, 5, 30])
    for seed in range(30):
        rng = np.random.default_rng(seed)
        angles = rng.normal(np.array([0.1, 0.6, 1.5])[group], 0.02)
        rows = np.stack([np.cos(angles), np.sin(angles)]) * rng.uniform(1, 2, len(group))
        chosen = hasan_columns(rows.astype(np.float32), 3, rng)
        np.testing.assert_array_equal(group[chosen], [0, 1, 2])


def test_a_column_stands_for_its_cluster_by_its_size():
    rows = np.zeros((2, 7), np.float32)
    rows[0, :4], rows[1, 4:] = [1, 2, 3, 6], [5, 1, 4]
    counts = np.zeros(7)
    for seed in range(1000):
        counts[hasan_columns(rows, 2, np.random.default_rng(seed))] += 1
    wanted = np.array([1, 2, 3, 6, 6, 1.2, 4.8]) / 12
    spread = np.sqrt(wanted * (1 - wanted) / 1000)
    assert (np.abs(counts / 1000 - wanted) < 4.5 * spread).all()
