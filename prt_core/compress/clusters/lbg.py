"""Assignment by projected distance: LBG iterations with affine clusters (Sloan et al. 2003)."""

import numpy as np

from prt_core.compress.linalg import principal_rows
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress

# Squared distances that differ by less than so much of a row's own square are equal: in float32
# that is what rounding leaves of them.
_EQUAL = 1e-6


def lbg_steps(coordinates, labels, rank, rounds=2, ranks=None, last_rounds=4):
    """Refine clusters for an affine model of `rank` components; a generator of `Progress`.

    Each round fits mean and components of every cluster and hands each row to the cluster whose
    affine space is nearest, or leaves it where that is as near. Components are added one by one,
    with rounds in between, so that clusters do not settle on the first local minimum.

    Parameters
    ----------
    coordinates : (n, m) float32
        Of the rows, in any orthonormal basis.
    labels : (n,) int
        Where to begin.
    rank : int
    rounds : int
        After each added component.
    ranks : sequence of int, optional
        Numbers of components to go through; default 1, 2, ... rank.
    last_rounds : int
        With all components.

    Returns
    -------
    (n,) int32
        Labels; a cluster that lost all its rows has none.
    """
    labels = np.array(labels, np.int32)
    n_clusters = int(labels.max()) + 1
    ranks = list(range(1, rank + 1) if ranks is None else ranks) or [0]
    for step, components in enumerate(ranks):
        for _ in range(last_rounds if components == ranks[-1] else rounds):
            models = _models(coordinates, labels, n_clusters, components)
            assigned, _ = assign(coordinates, models, labels)
            changed = int((assigned != labels).sum())
            labels = assigned
            yield Progress("clusters", step, len(ranks))
            if changed <= len(labels) // 1000:
                break
    return labels


def assign(coordinates, models, stay=None):
    """The nearest affine space of each row.

    Parameters
    ----------
    coordinates : (n, m) float32
    models : list of (mean, basis) or None
        None: an empty cluster, never chosen.
    stay : (n,) int32, optional
        Labels of clusters that have rows: each keeps its own where no other is nearer by more
        than rounding.

    Returns
    -------
    labels : (n,) int32
    distances : (n,) float32
        Squared.
    """
    used = [c for c, model in enumerate(models) if model is not None]
    means = np.stack([models[c][0] for c in used])
    basis = np.concatenate([models[c][1] for c in used])
    ends = np.cumsum([len(models[c][1]) for c in used])
    starts = np.concatenate([[0], ends[:-1]])
    # |x - m|^2 - |B (x - m)|^2 with one product for all clusters.
    offsets = np.concatenate([models[c][1] @ models[c][0] for c in used])
    lengths = (means**2).sum(axis=1)
    full = np.flatnonzero(ends > starts)
    place = np.zeros(len(models), np.int64)
    place[used] = np.arange(len(used))

    def nearest(part):
        rows = coordinates[part]
        squares = (rows**2).sum(axis=1)
        distances = squares[:, None] - 2 * (rows @ means.T) + lengths
        if len(full):
            inside = rows @ basis.T
            inside -= offsets
            inside *= inside
            distances[:, full] -= np.add.reduceat(inside, starts[full], axis=1)
        every, best = np.arange(len(rows)), distances.argmin(axis=1)
        if stay is not None:
            own = place[stay[part]]
            best = np.where(distances[every, own] - distances[every, best] <= _EQUAL * squares,
                            own, best)  # fmt: skip
        return best, distances[every, best]

    parts = [slice(first, first + 1024) for first in range(0, len(coordinates), 1024)]
    results = list(in_parallel(nearest, parts))
    labels = np.asarray(used, np.int32)[np.concatenate([best for best, _ in results])]
    return labels, np.maximum(np.concatenate([distance for _, distance in results]), 0)


def _models(coordinates, labels, n_clusters, rank):
    order = np.argsort(labels, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(labels, minlength=n_clusters))[:-1])

    def one(points):
        if not len(points):
            return None
        rows = coordinates[points]
        mean = rows.mean(axis=0)
        return mean, principal_rows(rows - mean, min(rank, len(points) - 1))[0]

    return list(in_parallel(one, members))
