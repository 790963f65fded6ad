"""Seams: where neighbouring points are in different clusters their errors may jump."""

import numpy as np
from scipy.spatial import cKDTree

from prt_core.errors import expect_array, expect_whole


def neighbour_pairs(positions, normals=None, groups=None, k=6):
    """Pairs of points that are neighbours on a surface.

    Parameters
    ----------
    positions : (n, 3) float
    normals : (n, 3) float, optional
        Neighbours' normals are less than 60 degrees apart.
    groups : (n,) int, optional
        Neighbours are of one group (an object).
    k : int
        Nearest points that are asked.

    Returns
    -------
    (m, 2) int
        Each pair once, the smaller index first.
    """
    positions = expect_array("positions", positions, (None, 3), np.float64)
    n_points = len(positions)
    if normals is not None:
        normals = expect_array("normals", normals, (n_points, 3))
    if groups is not None:
        groups = expect_array("groups", groups, (n_points,))
    k = min(expect_whole("k", k, 1), n_points - 1)
    if k < 1:
        return np.zeros((0, 2), int)
    _, near = cKDTree(positions).query(positions, k + 1)
    first = np.repeat(np.arange(len(positions)), k + 1)
    second = near.ravel()
    kept = first != second
    if normals is not None:
        kept &= np.einsum("ij,ij->i", normals[first], normals[second]) > 0.5
    if groups is not None:
        kept &= groups[first] == groups[second]
    pairs = np.sort(np.column_stack([first, second])[kept], axis=1)
    return np.unique(pairs, axis=0)


def border_pairs(labels, pairs):
    """The pairs whose points are in different clusters.

    Parameters
    ----------
    labels : (n,) int
        The cluster of each point.
    pairs : (m, 2) int
        See `neighbour_pairs`.

    Returns
    -------
    (k, 2) int
    """
    labels = expect_array("labels", labels, (None,), np.int64)
    pairs = expect_array("pairs", pairs, (None, 2), np.int64, 0, len(labels) - 1)
    return pairs[labels[pairs[:, 0]] != labels[pairs[:, 1]]]


def seam(colours, truth, pairs):
    """Jumps of the error between neighbours.

    Parameters
    ----------
    colours, truth : (n_points, n_channels) float
    pairs : (m, 2) int
        See `border_pairs`.

    Returns
    -------
    dict
        `largest` and `rms`: of the jump of (colours - truth) over a pair, relative to the mean
        of the truth.
    """
    colours = expect_array("colours", colours, (None, None), np.float64)
    truth = expect_array("truth", truth, colours.shape, np.float64)
    pairs = expect_array("pairs", pairs, (None, 2), np.int64, 0, len(colours) - 1)
    error = colours - truth
    jumps = np.linalg.norm(error[pairs[:, 0]] - error[pairs[:, 1]], axis=1)
    size = np.linalg.norm(truth, axis=1).mean() or 1.0
    if not len(jumps):
        return {"largest": 0.0, "rms": 0.0}
    return {"largest": float(jumps.max() / size), "rms": float(np.sqrt((jumps**2).mean()) / size)}


def border_points(labels, pairs):
    """The points at borders, and the other cluster that most of their neighbours are in.

    Returns
    -------
    points : (g,) int
        Each once, increasing.
    clusters : (g,) int
    """
    border = border_pairs(labels, pairs)
    both = np.concatenate([border, border[:, ::-1]])
    kinds, counts = np.unique(
        np.column_stack([both[:, 0], labels[both[:, 1]]]), axis=0, return_counts=True
    )
    # The most frequent cluster of each point; among equals the smaller number.
    order = np.lexsort([kinds[:, 1], -counts, kinds[:, 0]])
    points, first = np.unique(kinds[order, 0], return_index=True)
    return points, kinds[order[first], 1]
