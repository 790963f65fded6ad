"""Tangent frames: two directions at right angles to each normal."""

import numpy as np


def tangents(normals):
    """Two unit vectors at right angles to each unit vector, and to each other.

    Parameters
    ----------
    normals : (n, 3) float
        Unit vectors.

    Returns
    -------
    u, v : (n, 3) float64
        With the normal a right-handed frame, in this order. They turn smoothly with the normal,
        but for a seam where its z changes its sign.

    Source: Duff et al. 2017, Building an orthonormal basis, revisited.
    """
    x, y, z = np.asarray(normals, np.float64).T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1 / (sign + z)
    b = x * y * a
    u = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    return u, np.stack([b, sign + y * y * a, -y], axis=1)


def tangent_frames(normals):
    """(n, 3, 3) float64: rows are two tangents and the normal.

    `local @ tangent_frames(normals)[i]` turns vectors whose z points along normal i into the world.
    """
    normals = np.asarray(normals, np.float64)
    return np.stack([*tangents(normals), normals], axis=1)
