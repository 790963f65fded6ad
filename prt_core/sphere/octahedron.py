"""The unit sphere as a square: an octahedron, unfolded (Praun & Hoppe 2003), areas kept.

The upper half is the diamond in the middle, the lower half is folded out to the corners, which
are all the lowest point. Places on the square's edge that mirror each other in the edge's middle
are the same, so texels across the border are neighbours. Areas are kept after Clarberg (2008).
"""

import numpy as np


def octahedral_directions(u, v):
    """Unit vectors of places in the square.

    Parameters
    ----------
    u, v : float arrays of the same shape
        0 to 1, from left to right and from below.

    Returns
    -------
    (..., 3) float64
    """
    x, y = 2 * np.asarray(u, np.float64) - 1, 2 * np.asarray(v, np.float64) - 1
    inside = 1 - np.abs(x) - np.abs(y)
    radius = 1 - np.abs(inside)
    # Along a side of the diamond, from the first axis to the second.
    angle = np.pi / 4 * ((np.abs(y) - np.abs(x)) / np.maximum(radius, 1e-300) + 1)
    flat = radius * np.sqrt(2 - radius**2)
    return np.stack(
        [
            np.copysign(np.cos(angle) * flat, x),
            np.copysign(np.sin(angle) * flat, y),
            np.copysign(1 - radius**2, inside),
        ],
        axis=-1,
    )


def octahedral_square(directions):
    """Undo `octahedral_directions`: (...) u and v of (..., 3) unit vectors."""
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    radius = np.sqrt(np.maximum(1 - np.abs(z), 0))
    share = np.arctan2(np.abs(y), np.abs(x)) * 2 / np.pi
    a, b = radius * (1 - share), radius * share
    a, b = np.where(z < 0, 1 - b, a), np.where(z < 0, 1 - a, b)
    return (np.copysign(a, x) + 1) / 2, (np.copysign(b, y) + 1) / 2
