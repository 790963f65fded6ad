"""Real spherical harmonics: values, integrals over texels, rotation.

Index of degree l and order m is l (l + 1) + m; `order` n means degrees 0 to n - 1, n^2 functions.
Signs as in Sloan 2008 without the Condon-Shortley phase: Y_1 is proportional to (y, z, x).
"""

import numpy as np

from prt_core.errors import expect, expect_array, expect_vectors, expect_whole

MOST = 32
# Rotations at once.
_BLOCK = 1024


def harmonics(directions, order):
    """Values of the harmonics.

    Parameters
    ----------
    directions : (..., 3) float
        Unit vectors.
    order : int
        1 to 32.

    Returns
    -------
    (..., order^2) float64
        Orthonormal over the sphere.
    """
    order = expect_whole("order", order, 1, MOST)
    x, y, z = np.moveaxis(expect_vectors("directions", directions), -1, 0)
    result = np.empty((*z.shape, order * order))
    # Legendre functions divided by sin^m, fully normalised, so that no factorial appears; the
    # sines go with the angle as real and imaginary part of (x + i y)^m.
    cosine, sine = np.ones_like(z), np.zeros_like(z)
    diagonal = np.full(z.shape, np.sqrt(1 / (4 * np.pi)))
    for m in range(order):
        before, current = np.zeros_like(z), diagonal
        for degree in range(m, order):
            if degree > m:
                a = np.sqrt((4 * degree**2 - 1) / (degree**2 - m**2))
                b = np.sqrt(((degree - 1) ** 2 - m**2) / max(4 * (degree - 1) ** 2 - 1, 1))
                before, current = current, a * (z * current - b * before)
            centre = degree * (degree + 1)
            if m == 0:
                result[..., centre] = current
            else:
                result[..., centre + m] = np.sqrt(2) * current * cosine
                result[..., centre - m] = np.sqrt(2) * current * sine
        cosine, sine = x * cosine - y * sine, x * sine + y * cosine
        diagonal = diagonal * np.sqrt((2 * m + 3) / (2 * m + 2))
    return result


def texel_harmonics(resolution, order, faces, n_nodes=4):
    """Integrals of the harmonics over the texels of a cube map.

    Parameters
    ----------
    resolution : int
    order : int
    faces : (6, 3, 3) float
        Per face the axis it looks along, and those of its columns and rows.
    n_nodes : int
        Gauss-Legendre nodes along a texel's edge.

    Returns
    -------
    (6 resolution^2, order^2) float64
        The projection of a light (n_directions,) is `light @ integrals`.
    """
    resolution = expect_whole("resolution", resolution, 1, 1024)
    n_nodes = expect_whole("n_nodes", n_nodes, 1, 64)
    faces = expect_array("faces", faces, (6, 3, 3), np.float64)
    nodes, weights = np.polynomial.legendre.leggauss(n_nodes)
    place = (np.arange(resolution)[:, None] + (nodes + 1) / 2) / resolution * 2 - 1
    weight = np.outer(weights, weights).ravel() / resolution**2
    v, u = np.meshgrid(place.ravel(), place.ravel(), indexing="ij")
    local = np.stack([np.ones_like(u), u, v], axis=-1)
    square = (local**2).sum(axis=-1)
    local /= np.sqrt(square)[..., None]
    result = []
    for face in faces:
        values = harmonics(local @ face, order) * square[..., None] ** -1.5
        values = values.reshape(resolution, n_nodes, resolution, n_nodes, -1)
        values = np.moveaxis(values, 1, 2).reshape(resolution**2, n_nodes**2, -1)
        result.append(np.einsum("tnk,n->tk", values, weight))
    return np.concatenate(result)


def rotation_of_harmonics(matrix, order):
    """What turning a function does to its coefficients.

    Parameters
    ----------
    matrix : (3, 3) float
        Rotation; the turned function is f(matrix^T d).
    order : int

    Returns
    -------
    (order^2, order^2) float64
        Orthogonal, one block a degree: coefficients of the turned function are
        `result @ coefficients`.

    Raises
    ------
    PRTError
        `matrix` is no rotation.
    """
    order = expect_whole("order", order, 1, MOST)
    matrix = expect_array("matrix", matrix, (3, 3), np.float64, -2, 2)
    expect(
        np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6),
        "matrix: expected a rotation, (3, 3) with orthonormal rows",
    )
    # A degree's functions at a few well spread directions determine the block.
    points = _spread(4 * (2 * order + 1))
    turned, still = harmonics(points @ matrix, order), harmonics(points, order)
    result = np.zeros((order**2, order**2))
    for degree in range(order):
        block = slice(degree**2, (degree + 1) ** 2)
        result[block, block] = np.linalg.lstsq(still[:, block], turned[:, block], rcond=None)[0]
    return result


def rotations_of_harmonics(matrices, order):
    """`rotation_of_harmonics` of many rotations, a block for each degree.

    Parameters
    ----------
    matrices : (n, 3, 3) float
        Rotations; they are not checked.
    order : int

    Returns
    -------
    list of (n, 2 l + 1, 2 l + 1) float64
        For each degree l.
    """
    order = expect_whole("order", order, 1, MOST)
    matrices = expect_array("matrices", matrices, (None, 3, 3), np.float64, -2, 2)
    points = _spread(4 * (2 * order + 1))
    still = harmonics(points, order)
    blocks = [slice(degree**2, (degree + 1) ** 2) for degree in range(order)]
    inverses = [np.linalg.pinv(still[:, block]) for block in blocks]
    results = [np.empty((len(matrices), 2 * k + 1, 2 * k + 1)) for k in range(order)]
    for first in range(0, len(matrices), _BLOCK):
        part = slice(first, first + _BLOCK)
        turned = harmonics(np.matmul(points, matrices[part]), order)
        for result, block, inverse in zip(results, blocks, inverses, strict=True):
            result[part] = inverse @ turned[..., block]
    return results


def harmonic_products(order):
    """Products of two harmonics, as sums of harmonics of twice the order.

    Parameters
    ----------
    order : int
        Of the two; 1 to 16.

    Returns
    -------
    (order^2, order^2, (2 order - 1)^2) float64
        `Y_i Y_j = sum_k result[i, j, k] Y_k`; also the integral of all three.
    """
    order = expect_whole("order", order, 1, MOST // 2)
    points = _spread(16 * order**2)
    values = harmonics(points, order)
    products = (values[:, :, None] * values[:, None]).reshape(len(points), -1)
    result = np.linalg.lstsq(harmonics(points, 2 * order - 1), products, rcond=None)[0]
    result[np.abs(result) < 1e-12] = 0
    return result.T.reshape(order**2, order**2, -1)


def _spread(n_points):
    """Well spread directions, (n_points, 3): a few of them determine harmonics."""
    height = 1 - (np.arange(n_points) + 0.5) * 2 / n_points
    angle = np.arange(n_points) * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
