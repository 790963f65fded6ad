"""The few directions of a sparse point that are traced (Huang & Ramamoorthi 2010, section 5.2).

A direction tells the dense points around a sparse one apart where they disagree about it, and
where it was a feature of many of them. Directions are ranked by the product of both: the variance
of the neighbours' transport in it, and the number of neighbours it was a feature of. Those that
vary without being anyone's feature come last, while there are rays left for them.
"""

import numpy as np

# Counts as a feature of so much of a neighbour.
_NO_FEATURE = 1e-3


def feature_weights(rows, features, neighbours):
    """Variance times count of every direction for some sparse points.

    Parameters
    ----------
    rows : (n_rows, n_directions) float32
        Transport of the dense points of a neighbourhood.
    features : (n_rows, n_directions) float32
        1 where a direction was a feature of the row, else 0.
    neighbours : (n, k) int
        Rows around each sparse point; -1 is no row.

    Returns
    -------
    (n, n_directions) float32
    """
    share = membership(neighbours, len(rows))
    mean = share @ rows
    variance = share @ (rows * rows)
    variance -= mean * mean
    np.maximum(variance, 0, out=variance)
    # Rounding leaves a trace of variance where all rows are equal.
    variance[variance < 1e-6 * mean * mean] = 0
    variance *= share @ features + np.float32(_NO_FEATURE)
    return variance


def membership(neighbours, n_rows):
    """(n, n_rows) float32: the same share for each neighbour of a point; rows sum to 1."""
    share = np.zeros((len(neighbours), n_rows), np.float32)
    row, column = np.nonzero(neighbours >= 0)
    share[row, neighbours[row, column]] = 1
    return share / np.maximum(share.sum(axis=1, keepdims=True), 1)


def best_columns(weights, allowed, n_features):
    """The directions of largest weight.

    Parameters
    ----------
    weights : (n, n_directions) float32
        Not negative.
    allowed : (n, n_directions) bool
        Directions above the horizon of each point: others are known without a ray.
    n_features : int

    Returns
    -------
    columns : (n, m) int64
        m = min(n_features, n_directions), in the order of directions.
    valid : (n, m) bool
        Columns that are allowed and whose weight is not zero.
    """
    ranked = np.where(allowed, weights, 0)
    m = min(n_features, ranked.shape[1])
    columns = np.argpartition(ranked, -m, axis=1)[:, -m:]
    columns.sort(axis=1)
    return columns, np.take_along_axis(ranked, columns, axis=1) > 0
