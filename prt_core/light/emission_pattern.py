"""What a lamp sends out by direction, by place on it and by distance: tables and their reading."""

import numpy as np

from prt_core.light.environment import equirectangular


def pattern_on_sphere(table, directions):
    """Values of an equirectangular table at directions, linear between its pixels.

    Parameters
    ----------
    table : (n_rows, n_columns, 3) float
    directions : (m, 3) float
        Unit vectors.

    Returns
    -------
    (m, 3) float64
    """
    u, v = equirectangular(directions)
    return _between(table, (1 - v) * table.shape[0] - 0.5, u * table.shape[1] - 0.5, wraps=True)


def pattern_on_square(table, places):
    """Values of a table at places (m, 2) of the unit square, linear between its pixels.

    The first row is at the greatest y, the first column at the smallest x.
    """
    x, y = places.T
    return _between(table, (1 - y) * table.shape[0] - 0.5, x * table.shape[1] - 0.5, wraps=False)


def _between(table, row, column, wraps):
    n_rows, n_columns = table.shape[:2]
    top, left = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    down, right = (row - top)[:, None], (column - left)[:, None]
    rows = [np.clip(top + step, 0, n_rows - 1) for step in (0, 1)]
    columns = [left + step for step in (0, 1)]
    columns = [c % n_columns if wraps else np.clip(c, 0, n_columns - 1) for c in columns]
    upper, lower = (table[r, columns[0]] * (1 - right) + table[r, columns[1]] * right for r in rows)
    return upper * (1 - down) + lower * down


def falloff_at(table, distances):
    """(m,) factors at distances: smooth between the entries of a table, power laws beyond it.

    Parameters
    ----------
    table : (n, 2) float
        Distances that rise, and factors.
    distances : (m,) float
    """
    # Cubic in the logarithms, in which every power law is a line.
    known, factors = np.log(table[:, 0]), np.log(np.maximum(table[:, 1], 1e-30))
    sought = np.log(np.maximum(distances, 1e-30))
    slopes = np.gradient(factors, known)
    start = np.clip(np.searchsorted(known, sought) - 1, 0, len(known) - 2)
    width = known[start + 1] - known[start]
    t = np.clip((sought - known[start]) / width, 0, 1)
    rise = factors[start + 1] - factors[start]
    first, last = width * slopes[start] - rise, rise - width * slopes[start + 1]
    inside = factors[start] + t * rise + t * (1 - t) * ((1 - t) * first + t * last)
    below, above = np.minimum(sought - known[0], 0), np.maximum(sought - known[-1], 0)
    return np.exp(inside + slopes[0] * below + slopes[-1] * above)
