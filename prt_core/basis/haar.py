"""Two-dimensional Haar wavelets on the faces of a cube map: nonstandard and orthonormal.

Each level replaces squares of 2 x 2 texels by their mean (times 2) and three differences, then
goes on with the means alone (Stollnitz et al. 1995, the nonstandard decomposition). Faces of
n x n texels with n = 2^k m are halved k times; m x m scaling coefficients stay.
"""

import numpy as np

from prt_core.errors import expect, expect_array, expect_flag, expect_numbers, expect_whole

# Texels that are transformed at once.
_TEXELS = 1 << 18
_MOST_RESOLUTION = 1024


def haar_levels(size):
    """How many times a side of `size` can be halved."""
    size = expect_whole("size", size, 1)
    return (size & -size).bit_length() - 1


def haar_forward(faces, levels=None):
    """Wavelet coefficients of faces.

    Parameters
    ----------
    faces : (..., n, n) float
    levels : int, optional
        Default: as many as n allows.

    Returns
    -------
    (..., n, n) float, of the same type
        Scaling coefficients in the corner [0, 0]; beside them, level by level, the differences
        along columns (right), along rows (below) and both.
    """
    faces = expect_numbers("faces", faces)
    levels = _levels(faces, levels)
    n = faces.shape[-1]
    result = np.empty(faces.shape, faces.dtype)
    stack, out = faces.reshape(-1, n, n), result.reshape(-1, n, n)
    # So many faces at once stay in a core's cache.
    count = max(1, _TEXELS // (n * n))
    for first in range(0, len(stack), count):
        _forward(stack[first : first + count], out[first : first + count], levels)
    return result


def _forward(faces, out, levels):
    half = faces.dtype.type(0.5)
    for _ in range(levels):
        n = faces.shape[-1]
        middle = n // 2
        top, bottom = faces[:, 0::2], faces[:, 1::2]
        sums, differences = (top + bottom) * half, (top - bottom) * half
        left, right = sums[..., 0::2], sums[..., 1::2]
        np.subtract(left, right, out=out[:, :middle, middle:n])
        faces = left + right
        left, right = differences[..., 0::2], differences[..., 1::2]
        np.add(left, right, out=out[:, middle:n, :middle])
        np.subtract(left, right, out=out[:, middle:n, middle:n])
    n = faces.shape[-1]
    out[:, :n, :n] = faces


def haar_inverse(coefficients, levels=None):
    """Faces from their coefficients: the inverse, and the transpose, of `haar_forward`.

    Parameters
    ----------
    coefficients : (..., n, n) float
    levels : int, optional
        As `haar_forward` took them.

    Returns
    -------
    (..., n, n) float
    """
    result = np.array(expect_numbers("coefficients", coefficients))
    for level in reversed(range(_levels(result, levels))):
        size = result.shape[-1] >> level
        half = size // 2
        part = result[..., :size, :size]
        above, below = part[..., :half, :], part[..., half:, :]
        rows = np.empty_like(part)
        np.add(above, below, out=rows[..., 0::2, :])
        np.subtract(above, below, out=rows[..., 1::2, :])
        left, right = rows[..., :half], rows[..., half:]
        np.add(left, right, out=part[..., 0::2])
        np.subtract(left, right, out=part[..., 1::2])
        part *= result.dtype.type(0.5)
    return result


def haar_rows(rows, resolution, inverse=False):
    """`haar_forward` of rows of a cube map's texels.

    Parameters
    ----------
    rows : (..., 6 resolution^2) float
    resolution : int
    inverse : bool

    Returns
    -------
    (..., 6 resolution^2) float
    """
    rows = expect_rows(rows, resolution)
    expect_flag("inverse", inverse)
    faces = rows.reshape(*rows.shape[:-1], 6, resolution, resolution)
    return (haar_inverse if inverse else haar_forward)(faces).reshape(rows.shape)


def haar_texels(texels, resolution):
    """`haar_rows` of rows that are 1 at one texel: the few coefficients that are not zero.

    Parameters
    ----------
    texels : (m,) int
    resolution : int

    Returns
    -------
    places : (m, 3 levels + 1) int64
        Of the coefficients in the row, level by level.
    values : (m, 3 levels + 1) float32
    """
    n = expect_whole("resolution", resolution, 1, _MOST_RESOLUTION)
    texels = expect_array("texels", texels, (None,), np.int64, 0, 6 * n * n - 1)
    face, row, column = np.unravel_index(texels, (6, n, n))
    places, values, size, value = [], [], n, np.ones(len(texels), np.float32)
    for _ in range(haar_levels(n)):
        size, value = size // 2, value * np.float32(0.5)
        down, across = 1 - 2 * (row & 1), 1 - 2 * (column & 1)
        row, column = row >> 1, column >> 1
        places += [(row, size + column), (size + row, column), (size + row, size + column)]
        values += [value * across, value * down, value * down * across]
    places.append((row, column))
    values.append(value)
    flat = [face * n * n + r * n + c for r, c in places]
    return np.stack(flat, axis=1), np.stack(values, axis=1).astype(np.float32)


def expect_rows(rows, resolution):
    """Rows of a cube map's texels: (..., 6 resolution^2) numbers."""
    resolution = expect_whole("resolution", resolution, 1, _MOST_RESOLUTION)
    rows = expect_numbers("rows", rows)
    wanted = 6 * resolution**2
    expect(
        rows.ndim and rows.shape[-1] == wanted,
        f"rows: expected (..., {wanted}), got {rows.shape}",
    )
    return rows


def haar_areas(resolution):
    """Level and support of each wavelet of a cube map.

    Returns
    -------
    levels : (6 resolution^2,) int
        0 for scaling coefficients and the coarsest wavelets, one more for each finer level.
    areas : (6 resolution^2,) float64
        Texels in the support.
    """
    n = expect_whole("resolution", resolution, 1, _MOST_RESOLUTION)
    levels = haar_levels(n)
    level = np.zeros((n, n), int)
    for step in range(levels):
        size = n >> step
        band = np.ones((size, size), bool)
        band[: size // 2, : size // 2] = False
        level[:size, :size][band] = levels - 1 - step
    area = 4.0 ** (levels - level)
    return np.tile(level.ravel(), 6), np.tile(area.ravel(), 6)


def _levels(array, levels):
    n = array.shape[-1] if array.ndim else 0
    expect(
        array.ndim >= 2 and array.shape[-2] == n > 0 and array.dtype.kind == "f",
        f"faces: expected (..., n, n) floats, got {array.shape} {array.dtype}",
    )
    most = haar_levels(n)
    return most if levels is None else expect_whole("levels", levels, 0, most)
