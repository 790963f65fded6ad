"""Hidden points in large triangles, so that a floor of two triangles bounces light correctly.

A triangle of level n carries a lattice of (n + 1)(n + 2) / 2 points at barycentric coordinates
(i / n, j / n); rays still hit the one large triangle, and a hit is interpolated in its lattice
cell. So refinement makes no cracks and costs the caster nothing.
"""

import numpy as np

# The longest edge that bounces without hidden points, in units of the receivers' size.
TARGET_EDGE = 1 / 32


def lattice_size(level):
    """Number of lattice points of a triangle of this level."""
    return (level + 1) * (level + 2) // 2


def lattice_index(level, i, j):
    """Index of lattice point (i, j), 0 <= i + j <= level; rows of constant i, one after another."""
    return i * (level + 1) - i * (i - 1) // 2 + j


def lattice_coordinates(level):
    """(lattice_size, 2) int: (i, j) of each lattice point, in the order of `lattice_index`."""
    return np.array([(i, j) for i in range(level + 1) for j in range(level + 1 - i)], np.int64)


def refinement_levels(stack, max_hidden=None):
    """Level of each triangle (n_triangles,) int32 from its longest edge and a budget of points."""
    vertices, edge = stack.vertices, np.empty(len(stack.triangles))
    used = np.zeros(len(vertices), bool)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    receives = stack.receives[stack.triangle_object]
    receives = receives if receives.any() else np.ones(len(receives), bool)
    for part in stack.parts():
        triangles = stack.triangles[part]
        used[triangles] = True
        a, b, c = np.moveaxis(vertices[triangles], 1, 0)
        sides = [np.linalg.norm(x - y, axis=1) for x, y in ((a, b), (b, c), (c, a))]
        edge[part] = np.maximum.reduce(sides)
        seen = vertices[triangles[receives[part]]].reshape(-1, 3)
        low = np.minimum(low, seen.min(axis=0, initial=np.inf))
        high = np.maximum(high, seen.max(axis=0, initial=-np.inf))
    size, n_corners = float((high - low).max()), int(used.sum())
    budget = max(2000, n_corners // 2) if max_hidden is None else max_hidden
    target = max(TARGET_EDGE * size, 1e-9)
    while True:
        levels = np.clip(np.ceil(edge / target), 1, 256).astype(np.int32)
        if int((lattice_size(levels) - 3).sum(dtype=np.int64)) <= budget or (levels == 1).all():
            return levels
        target *= 1.25


def lattice_of_hits(levels, barycentric):
    """Lattice cell and weights of hits.

    Parameters
    ----------
    levels : (m,) int
    barycentric : (m, 2) float
        Weights of the second and third corner.

    Returns
    -------
    cell : (m, 3) int64
        Indices into the triangle's lattice.
    weights : (m, 3) float32
        Non-negative, sum to 1.
    """
    levels = np.asarray(levels, np.int64)
    u, v = np.clip(np.asarray(barycentric, np.float64).T, 0, 1)
    total = u + v
    shrink = np.where(total > 1, total, 1)
    u, v = u / shrink, v / shrink
    # Nearly all triangles of most scenes are one cell.
    cell = np.empty((len(levels), 3), np.int64)
    cell[:] = lattice_index(1, 0, 0), lattice_index(1, 1, 0), lattice_index(1, 0, 1)
    cut = np.flatnonzero(levels > 1)
    if len(cut):
        cell[cut], u[cut], v[cut] = _cell_of(levels[cut], u[cut], v[cut])
    weights = np.clip(np.stack([1 - u - v, u, v]), 0, 1)
    return cell, (weights / weights.sum(axis=0)).T.astype(np.float32)


def _cell_of(levels, u, v):
    """The cell of places in triangles that are cut, and the weights of its last two corners."""
    u, v = u * levels, v * levels
    i = np.minimum(np.floor(u).astype(np.int64), levels - 1)
    # On the far edge: step back into the last cell.
    j = np.minimum(np.floor(v).astype(np.int64), levels - 1 - i)
    u, v = u - i, v - j
    upper = (u + v > 1) & (i + j < levels - 1)
    cell = np.stack(
        [
            lattice_index(levels, i + upper, j + upper),
            lattice_index(levels, i + 1, j),
            lattice_index(levels, i, j + 1),
        ],
        axis=1,
    )
    # In the upper triangle of a cell the second corner is (i+1, j), opposite to v.
    return cell, np.where(upper, 1 - v, u), np.where(upper, 1 - u, v)
