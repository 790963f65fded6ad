"""From the unit square to discs, cones and the hemisphere: where samples fall, and how densely.

Every warp takes (..., 2) numbers from 0 to 1 and keeps their precision; its density is beside it.
Directions are in the local frame, z along the normal (see `frames.tangent_frames`).
"""

import numpy as np


def square_to_disc(uv):
    """Places (..., 2) on the unit disc, evenly, of `uv` (..., 2)."""
    radius, angle = np.sqrt(uv[..., 0]), _turn(uv)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def disc_density():
    """Of places on the unit disc, for its area."""
    return 1 / np.pi


def square_to_cosine(uv):
    """Directions of the hemisphere, as densely as their cosine: (..., 3) unit vectors of `uv`.

    Source: Malley's method; Pharr, Jakob and Humphreys 2023, section A.5.3.
    """
    height = np.sqrt(np.maximum(0, 1 - uv[..., 0]))
    return np.concatenate([square_to_disc(uv), height[..., None]], axis=-1)


def cosine_density(cosine):
    """Of directions whose cosine with the normal is given, for solid angle."""
    return np.maximum(cosine, 0) / np.pi


def square_to_cone(uv, cap):
    """Directions evenly within a cone about z: (..., 3) unit vectors.

    Parameters
    ----------
    uv : (..., 2) float
    cap : float or (...) float
        1 - cos of the cone's half angle, 0 to 2: so that narrow cones are exact.
    """
    cosine = 1 - uv[..., 0] * cap
    sine, angle = np.sqrt(np.maximum(1 - cosine**2, 0)), _turn(uv)
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), cosine], axis=-1)


def cone_density(cap):
    """Of directions within a cone of `cap` (see `square_to_cone`), for solid angle."""
    return 1 / (2 * np.pi * np.asarray(cap, np.float64))


def _turn(uv):
    return uv.dtype.type(2 * np.pi) * uv[..., 1]
