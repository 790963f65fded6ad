"""Columns chosen by clustering: the rivals of Huang & Ramamoorthi's figure 5.

Both cluster the columns of the transport matrix on a reduced set of rows and take one column of
each cluster, the same for every point of a region.
"""

import numpy as np

# Share of the clusters made by sampling centres; the others by splitting (Hašan et al., section 5).
_SAMPLED = 2 / 3


def hasan_columns(rows, n_columns, rng):
    """Weighted k-clustering of columns (Hašan, Pellacini & Bala 2007, section 5).

    The cost of a cluster is the sum over its pairs of |a| |b| - a . b, that is
    (sum |a|)^2 - |sum a|^2: columns that only differ in size belong together, large ones count
    more. Centres are sampled by what they would save; then the costliest clusters are split. Of
    each cluster one column is drawn with probability in proportion to its size.

    Parameters
    ----------
    rows : (n_rows, n_directions) float32
        The reduced rows.
    n_columns : int
    rng : numpy.random.Generator

    Returns
    -------
    (m,) int64
        Ascending; m = n_columns or, where fewer columns are not zero, these.
    """
    columns = np.asarray(rows.T, np.float64)
    size = np.linalg.norm(columns, axis=1)
    used = np.flatnonzero(size > 0)
    n_columns = min(n_columns, len(used))
    columns, size = columns[used], size[used]
    cluster, n_clusters = _sample_centres(columns, size, max(1, int(_SAMPLED * n_columns)), rng)
    cost = np.array([_cost(columns, size, cluster == c) for c in range(n_clusters)])
    while n_clusters < n_columns:
        worst = int(cost.argmax())
        members = np.flatnonzero(cluster == worst)
        if len(members) < 2:
            cost[worst] = -1
            continue
        cluster[_second_part(columns[members], size[members], members, rng)] = n_clusters
        cost[worst] = _cost(columns, size, cluster == worst)
        cost = np.append(cost, _cost(columns, size, cluster == n_clusters))
        n_clusters += 1
    chosen = []
    for c in range(n_clusters):
        members = np.flatnonzero(cluster == c)
        if len(members):
            chosen.append(rng.choice(members, p=size[members] / size[members].sum()))
    return np.sort(used[np.array(chosen, np.int64)])


def _sample_centres(columns, size, n_centres, rng):
    """Cluster of each column after sampling centres by the distances they leave."""
    cluster = np.zeros(len(columns), np.int64)
    first = rng.choice(len(columns), p=size / size.sum())
    distance = np.maximum(size * size[first] - columns @ columns[first], 0)
    n_clusters = 1
    while n_clusters < n_centres and distance.sum() > 0:
        centre = rng.choice(len(columns), p=distance / distance.sum())
        other = np.maximum(size * size[centre] - columns @ columns[centre], 0)
        nearer = other < distance
        nearer[centre] = True
        cluster[nearer] = n_clusters
        distance = np.minimum(distance, other)
        distance[centre] = 0
        n_clusters += 1
    return cluster, n_clusters


def _cost(columns, size, members):
    return size[members].sum() ** 2 - (columns[members].sum(axis=0) ** 2).sum()


def _second_part(columns, size, members, rng):
    """Members of one half of a cluster: cut where it pays most, along the line of two of them."""
    ends = rng.choice(len(members), 2, replace=False, p=_likely(size))
    unit = columns / size[:, None]
    order = np.argsort(unit @ (unit[ends[0]] - unit[ends[1]]), kind="stable")
    sums, sizes = np.cumsum(columns[order], axis=0), np.cumsum(size[order])
    left = sizes**2 - (sums**2).sum(axis=1)
    right = (sizes[-1] - sizes) ** 2 - ((sums[-1] - sums) ** 2).sum(axis=1)
    cut = int((left + right)[:-1].argmin()) + 1
    return members[order[cut:]]


def _likely(size):
    return size / size.sum()


def wang_columns(rows, n_columns, rng):
    """k-means of columns (Wang, Dong, Tong, Lin & Guo 2009): those nearest to the centres.

    Parameters and return as `hasan_columns`.
    """
    from sklearn.cluster import KMeans

    columns = np.asarray(rows.T, np.float32)
    used = np.flatnonzero(columns.any(axis=1))
    if len(used) <= n_columns:
        return used
    seed = int(rng.integers(1 << 31))
    means = KMeans(n_columns, n_init=1, max_iter=30, random_state=seed).fit(columns[used])
    distance = means.transform(columns[used])[np.arange(len(used)), means.labels_]
    order = np.lexsort([distance, means.labels_])
    first = np.concatenate([[True], np.diff(means.labels_[order]) != 0])
    return np.sort(used[order[first]])


COLUMN_CHOICES = {"hasan": hasan_columns, "wang": wang_columns}
