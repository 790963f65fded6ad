"""Clusters of HRDFs, and the HRDFs that stand for one (Miandji et al. 2013, section 2).

K-means (Lloyd 1982) by the L1 distance, which a few bright texels do not rule, begun by k-means++
(Arthur and Vassilvitskii 2007). Where points lie does not matter.
"""

import numpy as np
from scipy.spatial.distance import cdist

from prt_core.errors import expect, expect_number, expect_seed, expect_whole
from prt_core.lightfield.compressor import expect_hrdfs
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator

_BLOCK = 1024
# Rounds at most, and the share of points below which a change of cluster counts as none.
_ROUNDS, _SETTLED = 20, 2e-3
# Points that centres are drawn from.
_SAMPLE = 8192
# HRDFs that train at most, and rounds in which they are drawn.
_MOST_TRAINING, _DRAWS = 4096, 64


def cluster_hrdfs_steps(hrdfs, n_clusters, seed=0):
    """Clusters of HRDFs; a generator of `Progress`.

    Parameters
    ----------
    hrdfs : (n_points, m1, m2) float
    n_clusters : int
    seed : int

    Returns
    -------
    (n_points,) int32
        Each below the number of clusters that have points, which is less than `n_clusters` where
        there are fewer different HRDFs.
    """
    hrdfs, _ = expect_hrdfs(hrdfs)
    n_clusters, seed = expect_whole("n_clusters", n_clusters, 1), expect_seed(seed)
    rows = hrdfs.reshape(len(hrdfs), -1)
    rng = generator(seed, Stage.HRDF_CLUSTERS)
    sample = rows
    if len(rows) > _SAMPLE:
        sample = rows[rng.choice(len(rows), _SAMPLE, replace=False)]
    centres = _first_centres(sample, n_clusters, rng)
    labels = np.zeros(len(rows), np.int32)
    for turn in range(_ROUNDS if len(centres) > 1 else 0):
        nearest = yield from _nearest_steps(rows, centres, turn)
        changed = np.count_nonzero(nearest != labels)
        labels = nearest
        if turn and changed <= _SETTLED * len(rows):
            break
        used = np.unique(labels)
        centres = np.stack([rows[labels == c].mean(axis=0) for c in used])
    return np.unique(labels, return_inverse=True)[1].reshape(-1).astype(np.int32)


def _first_centres(rows, n_clusters, rng):
    """Rows drawn one after another, by how far each is from those before; fewer where all are 0."""
    chosen = [int(rng.integers(len(rows)))]
    left = np.full(len(rows), np.inf)
    while len(chosen) < n_clusters:
        left = np.minimum(left, cdist(rows, rows[chosen[-1:]], "cityblock")[:, 0])
        share = np.cumsum(left)
        if share[-1] <= 0:
            break
        chosen.append(int(np.searchsorted(share, rng.random() * share[-1], "right")))
    return rows[chosen]


def _nearest_steps(rows, centres, turn):
    def nearest(first):
        return cdist(rows[first : first + _BLOCK], centres, "cityblock").argmin(axis=1)

    parts = []
    for part in in_parallel(nearest, range(0, len(rows), _BLOCK)):
        parts.append(part)
        yield Progress("clusters of HRDFs", turn, _ROUNDS)
    return np.concatenate(parts).astype(np.int32)


def spread_subset(hrdfs, share, seed=0):
    """HRDFs that stand for all: drawn by k-means++, so that rare ones are not missed.

    Many are drawn between two looks at the distances (Bahmani et al. 2012), which are L2 here: a
    matrix product, where the L1 distance to thousands of HRDFs takes a minute.

    Parameters
    ----------
    hrdfs : (n, m1, m2) float
    share : float
        Of all, above 0; 4,096 at most.
    seed : int

    Returns
    -------
    (m,) int64
        Ascending. At least one that is not 0, where there is one; fewer than `share` where the
        others are copies.
    """
    hrdfs, _ = expect_hrdfs(hrdfs)
    share = expect_number("share", share, above=0, most=1)
    rows = hrdfs.reshape(len(hrdfs), -1)
    wanted = min(-(-len(rows) * share // 1), _MOST_TRAINING)
    if wanted >= len(rows):
        return np.arange(len(rows))
    rng = generator(seed, Stage.HRDF_TRAINING)
    squares = np.einsum("nk,nk->n", rows, rows)
    # As if an HRDF of zeros had been drawn first: what is near it adds nothing to training.
    left, chosen = squares.astype(np.float64), np.zeros(len(rows), bool)
    step = max(1, int(wanted) // _DRAWS)
    while (count := int(wanted) - int(chosen.sum())) > 0 and left.any():
        count = min(count, step, int(np.count_nonzero(left)))
        drawn = rng.choice(len(rows), count, replace=False, p=left / left.sum())
        chosen[drawn] = True
        distances = squares[:, None] - 2 * (rows @ rows[drawn].T) + squares[drawn]
        np.minimum(left, np.maximum(distances, 0).min(axis=1), out=left)
        # Rounding leaves a little where the distance is 0.
        left[left < 1e-6 * squares] = 0
        left[chosen] = 0
    return np.flatnonzero(chosen)


def expect_clusters(n_clusters, n_points):
    """None, or a whole number of at least 1 that `n_points` allow."""
    if n_clusters is None:
        return None
    n_clusters = expect_whole("n_clusters", n_clusters, 1)
    expect(
        n_clusters <= n_points,
        f"n_clusters: {n_clusters} clusters of {n_points} points; give fewer",
    )
    return n_clusters
