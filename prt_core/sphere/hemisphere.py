"""The hemisphere as a square, areas kept: the concentric map.

Squares around the middle of the unit square become circles around the pole (Shirley and Chiu 1997),
radii such that solid angles are in proportion to areas. So a table of m1 x m2 texels has texels of
equal solid angle, near the pole as at the horizon, and neighbours stay neighbours.
"""

import numpy as np


def hemisphere_directions(u, v):
    """Unit vectors of places in the square.

    Parameters
    ----------
    u, v : float arrays of the same shape
        0 to 1; the middle is the pole, the border the horizon.

    Returns
    -------
    (..., 3) float64
        z along the normal, 0 or above.
    """
    x, y = 2 * np.asarray(u, np.float64) - 1, 2 * np.asarray(v, np.float64) - 1
    wide = np.abs(x) > np.abs(y)
    radius = np.where(wide, x, y)
    # Within a quarter the angle goes with the place along the side of the square.
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.pi / 4 * np.where(wide, y / x, x / y)
    share = np.where(radius == 0, 0.0, share)
    angle = np.where(wide, share, np.pi / 2 - share)
    flat = radius * np.sqrt(np.maximum(2 - radius**2, 0))
    return np.stack(
        [flat * np.cos(angle), flat * np.sin(angle), np.maximum(1 - radius**2, 0)], axis=-1
    )


def hemisphere_square(directions):
    """Undo `hemisphere_directions`: (...) u and v of (..., 3) unit vectors with z >= 0."""
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    radius = np.sqrt(np.clip(1 - z, 0, 1))
    angle = np.arctan2(np.abs(y), np.abs(x))
    wide = np.abs(x) > np.abs(y)
    share = np.where(wide, angle, np.pi / 2 - angle) * 4 / np.pi * radius
    a, b = np.where(wide, radius, share), np.where(wide, share, radius)
    return (np.copysign(a, x) + 1) / 2, (np.copysign(b, y) + 1) / 2


def hemisphere_solid_angle(width, height):
    """Of each texel of a table of `width` x `height` texels: all have the same."""
    return 2 * np.pi / (width * height)
