"""K-means (Lloyd 1982), begun by k-means++ (Arthur & Vassilvitskii 2007)."""

import numpy as np

from prt_core.runtime.main_thread import in_thread
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator

# Points of a block, and distances of a block: each stays in a core's cache.
_BLOCK, _DISTANCES = 2048, 1 << 19
# Points, and points a cluster, that begin is drawn from; rounds at most.
_SAMPLE, _SAMPLE_FACTOR, _ROUNDS = 4096, 3, 20
# Rounds end when fewer than so many of the points change their cluster.
_SETTLED = 2e-3


def kmeans_steps(coordinates, n_clusters, seed=0):
    """Clusters of points; a generator of `Progress`.

    The same seed gives the same labels on one machine: blocks have the same size and one BLAS
    thread however many work on them, and sums are taken in one order.

    Parameters
    ----------
    coordinates : (n, k) float32
    n_clusters : int
    seed : int

    Returns
    -------
    (n,) int32
        Labels below min(n_clusters, n); fewer are used where points coincide.
    """
    n_points, width = coordinates.shape
    n_clusters = min(n_clusters, n_points)
    if width == 0 or n_clusters <= 1:
        return np.zeros(n_points, np.int32)
    if n_clusters == n_points:
        return np.arange(n_points, dtype=np.int32)
    rng = generator(seed, Stage.KMEANS)
    centres = yield from in_thread("clusters", _first_centres, coordinates, n_clusters, rng)
    labels = np.full(n_points, -1, np.int32)
    for turn in range(_ROUNDS):
        nearest, distances = yield from _nearest_steps(coordinates, centres, turn)
        changed = np.count_nonzero(nearest != labels)
        labels = nearest
        if changed <= _SETTLED * n_points:
            break
        centres = _means(coordinates, labels, distances, centres)
    return labels


def _first_centres(coordinates, n_clusters, rng):
    """Centres drawn one after another, by the square of how far points are from those before."""
    n_sample = min(len(coordinates), max(_SAMPLE, _SAMPLE_FACTOR * n_clusters))
    sample = coordinates[rng.choice(len(coordinates), n_sample, replace=False)]
    squares = np.einsum("nk,nk->n", sample, sample)
    chosen = [int(rng.integers(n_sample))]
    left = np.full(n_sample, np.inf, np.float32)
    for _ in range(n_clusters - 1):
        last = chosen[-1]
        distances = squares - 2 * (sample @ sample[last]) + squares[last]
        np.minimum(left, np.maximum(distances, 0), out=left)
        left[last] = 0
        share = np.cumsum(left, dtype=np.float64)
        if share[-1] <= 0:
            break
        chosen.append(int(np.searchsorted(share, rng.random() * share[-1], "right")))
    return sample[chosen]


def _nearest_steps(coordinates, centres, turn):
    """Nearest centre of every point, and its squared distance."""
    half = 0.5 * np.einsum("ck,ck->c", centres, centres)
    size = int(np.clip(_DISTANCES // len(centres), 16, _BLOCK))

    def nearest(first):
        block = coordinates[first : first + size]
        # |x - c|^2 / 2 without the part that is the same for all centres.
        distances = half - block @ centres.T
        label = distances.argmin(axis=1)
        best = np.take_along_axis(distances, label[:, None], 1)[:, 0]
        return label, 2 * best + np.einsum("nk,nk->n", block, block)

    parts = []
    for part in in_parallel(nearest, range(0, len(coordinates), size)):
        parts.append(part)
        yield Progress("clusters", turn, _ROUNDS)
    labels, distances = (np.concatenate(values) for values in zip(*parts, strict=True))
    return labels.astype(np.int32), np.maximum(distances, 0)


def _means(coordinates, labels, distances, centres):
    """Means of the clusters; those without points begin again at the points furthest off."""
    order = np.argsort(labels, kind="stable")
    counts = np.bincount(labels, minlength=len(centres))
    used = np.flatnonzero(counts)
    first = (np.cumsum(counts) - counts)[used]
    sums = np.add.reduceat(coordinates[order], first, axis=0, dtype=np.float64)
    result = centres.copy()
    result[used] = (sums / counts[used, None]).astype(np.float32)
    empty = np.flatnonzero(counts == 0)
    if len(empty):
        furthest = np.argsort(-distances, kind="stable")[: len(empty)]
        result[empty] = coordinates[furthest]
    return result
