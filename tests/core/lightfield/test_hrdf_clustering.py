"""Clusters of HRDFs by the L1 distance, and the HRDFs that train."""

import numpy as np
import pytest

from prt_core import run
from prt_core.errors import PRTError
from prt_core.lightfield import cluster_hrdfs_steps, spread_subset


def groups(n=90, n_groups=3, seed=0):
    """HRDFs around a few that are far from each other, and which is around which."""
    rng = np.random.default_rng(seed)
    middles = rng.random((n_groups, 5, 3)) * 10
    labels = np.arange(n) % n_groups
    return (middles[labels] + 0.1 * rng.random((n, 5, 3))).astype(np.float32), labels


def test_clusters_are_the_groups():
    hrdfs, labels = groups()
    result = run(cluster_hrdfs_steps(hrdfs, 3, seed=1))
    assert result.dtype == np.int32 and result.shape == (90,)
    assert len({(int(a), int(b)) for a, b in zip(result, labels, strict=True)}) == 3
    assert (result == run(cluster_hrdfs_steps(hrdfs, 3, seed=1))).all()
    # Where points lie in the order plays no part.
    order = np.random.default_rng(2).permutation(90)
    mixed = run(cluster_hrdfs_steps(hrdfs[order], 3, seed=1))
    assert len({(int(a), int(b)) for a, b in zip(mixed, labels[order], strict=True)}) == 3


def test_a_bright_texel_does_not_rule_by_l1():
    # Two kinds that differ a little in all cells; half of each has one bright texel.
    kind, bright = np.arange(80) % 2, np.arange(80) // 2 % 2
    hrdfs = np.full((80, 8, 8), 1.0) + 0.5 * kind[:, None, None]
    hrdfs[:, 3, 4] += 12 * bright
    labels = run(cluster_hrdfs_steps(hrdfs, 2, seed=3))
    # L1: 32 between kinds, 12 between bright and not; L2: 4 and 12.
    assert len({(int(a), int(b)) for a, b in zip(labels, kind, strict=True)}) == 2


def test_copies_and_zeros_make_fewer_clusters():
    for hrdfs in (np.zeros((6, 4, 2)), np.ones((5, 4, 2)), np.ones((1, 1, 1))):
        assert (run(cluster_hrdfs_steps(hrdfs, 4)) == 0).all()
    two = np.concatenate([np.zeros((6, 4, 2)), np.ones((5, 4, 2))])
    labels = run(cluster_hrdfs_steps(two, 7))
    assert set(labels) == {0, 1} and len(set(labels[:6])) == 1
    with pytest.raises(PRTError, match="n_clusters: expected a whole number"):
        run(cluster_hrdfs_steps(two, 0))


def test_what_trains_is_spread_and_misses_nothing_rare():
    hrdfs, labels = groups(300)
    hrdfs[123] += 50
    chosen = spread_subset(hrdfs, 0.1, seed=4)
    assert len(chosen) == 30 and (np.diff(chosen) > 0).all()
    assert 123 in chosen and set(labels[chosen]) == {0, 1, 2}
    assert (chosen == spread_subset(hrdfs, 0.1, seed=4)).all()
    assert (spread_subset(hrdfs, 1.0) == np.arange(300)).all()


def test_zeros_and_copies_do_not_train():
    hrdfs = np.zeros((40, 3, 3))
    assert len(spread_subset(hrdfs, 0.5)) == 0
    hrdfs[7:29] = 1
    assert len(spread_subset(hrdfs, 0.5)) == 1
    hrdfs[3, 1, 1] = 1e6
    assert 3 in spread_subset(hrdfs, 0.5)
    with pytest.raises(PRTError, match="share: expected a number above 0 and <= 1"):
        spread_subset(hrdfs, 0)
