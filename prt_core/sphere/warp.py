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


def square_to_cosine_power(uv, exponent_x, exponent_y=None):
    """Directions of the hemisphere, as densely as a power of their cosine.

    Parameters
    ----------
    uv : (..., 2) float
    exponent_x, exponent_y : float or (...) float
        Along x and along y, 0 or more; default of the second: the first.

    Returns
    -------
    (..., 3) array
        Unit vectors.

    Source: Ashikhmin and Shirley 2000, equations 9 and 10.
    """
    one, turn = uv.dtype.type(1), _turn(uv)
    x = np.asarray(exponent_x, uv.dtype)
    y = x if exponent_y is None else np.asarray(exponent_y, uv.dtype)
    across, up = np.sqrt(y + one) * np.cos(turn), np.sqrt(x + one) * np.sin(turn)
    length = np.hypot(across, up)
    across, up = across / length, up / length
    exponent = x * across**2 + y * up**2
    # Logarithm of the cosine: the sine stays exact where all directions are close to the pole.
    with np.errstate(divide="ignore"):
        log = np.log1p(-uv[..., 0]) / (exponent + one)
    sine = np.sqrt(-np.expm1(2 * log))
    return np.stack([sine * across, sine * up, np.exp(log)], axis=-1)


def cosine_power_density(directions, exponent_x, exponent_y=None):
    """Of directions of `square_to_cosine_power`, for solid angle; 0 below the horizon.

    Parameters
    ----------
    directions : (..., 3) float
    exponent_x, exponent_y : float or (...) float

    Returns
    -------
    (...) array
    """
    x = np.asarray(exponent_x, directions.dtype)
    y = x if exponent_y is None else np.asarray(exponent_y, directions.dtype)
    norm = np.sqrt((x + 1) * (y + 1)) / directions.dtype.type(2 * np.pi)
    return norm * cosine_power(directions, x, y)


def cosine_power(directions, exponent_x, exponent_y):
    """The cosine of directions to a power that goes from one along x to one along y.

    Parameters
    ----------
    directions : (..., 3) float
    exponent_x, exponent_y : float or (...) float

    Returns
    -------
    (...) array
        0 below the horizon.
    """
    x, y, z = (directions[..., k] for k in range(3))
    flat, tiny = x * x + y * y, np.finfo(directions.dtype).tiny
    exponent = (exponent_x * x * x + exponent_y * y * y) / np.maximum(flat, tiny)
    exponent = np.where(flat > tiny, exponent, exponent_x)
    # By the sine near the pole, where the cosine is rounded to 1.
    log = np.where(flat < 0.5, np.log1p(-np.minimum(flat, 0.5)) / 2, np.log(np.clip(z, tiny, 1)))
    return np.where(z > 0, np.exp(exponent * log), 0)


def square_to_ggx_normals(uv, outgoing, alpha_x, alpha_y):
    """Normals of the GGX microfacets that a viewer sees, as densely as he sees them.

    Parameters
    ----------
    uv : (..., 2) float
    outgoing : (..., 3) float
        Unit vectors to the viewer, above the horizon.
    alpha_x, alpha_y : float or (...) float
        Roughness along x and y, above 0.

    Returns
    -------
    (..., 3) array
        Unit vectors, z 0 or above.

    Source: Heitz 2018, Sampling the GGX distribution of visible normals.
    """
    alpha_x, alpha_y = (np.asarray(a, outgoing.dtype) for a in (alpha_x, alpha_y))
    x, y, z = alpha_x * outgoing[..., 0], alpha_y * outgoing[..., 1], outgoing[..., 2]
    x, y, z = _unit(x, y, np.maximum(z, 0))
    # Two directions at right angles to the stretched view.
    flat = np.hypot(x, y)
    seen_aslant = flat > 1e-6
    scale = 1 / np.where(seen_aslant, flat, 1)
    ux, uy = np.where(seen_aslant, -y * scale, 1), np.where(seen_aslant, x * scale, 0)
    vx, vy, vz = -z * uy, z * ux, x * uy - y * ux
    place = square_to_disc(uv)
    p, share = place[..., 0], (1 + z) / 2
    q = (1 - share) * np.sqrt(np.maximum(1 - p * p, 0)) + share * place[..., 1]
    r = np.sqrt(np.maximum(1 - p * p - q * q, 0))
    normal = [p * ux + q * vx + r * x, p * uy + q * vy + r * y, np.maximum(q * vz + r * z, 0)]
    return np.stack(_unit(alpha_x * normal[0], alpha_y * normal[1], normal[2]), axis=-1)


def ggx_normal_density(normals, outgoing, alpha_x, alpha_y):
    """Of the normals of `square_to_ggx_normals`, for solid angle.

    Parameters
    ----------
    normals : (..., 3) float
    outgoing : (..., 3) float
    alpha_x, alpha_y : float or (...) float

    Returns
    -------
    (...) array
        0 for normals below the horizon, and for those that face away from the viewer.
    """
    alpha_x, alpha_y = (np.asarray(a, outgoing.dtype) for a in (alpha_x, alpha_y))
    x, y, z = (outgoing[..., k] for k in range(3))
    length = np.sqrt((alpha_x * x) ** 2 + (alpha_y * y) ** 2 + z * z)
    facing = (normals * outgoing).sum(axis=-1)
    area = 2 * np.maximum(facing, 0) / (np.maximum(z, 0) + length)
    return np.where(normals[..., 2] > 0, area * ggx_density(normals, alpha_x, alpha_y), 0)


def ggx_density(normals, alpha_x, alpha_y):
    """Area of GGX microfacets with these normals, for solid angle: the distribution D.

    Parameters
    ----------
    normals : (..., 3) float
        Of any length.
    alpha_x, alpha_y : float or (...) float

    Returns
    -------
    (...) array
        For the surface's own area; times the cosine it integrates to 1 over the hemisphere.

    Source: Walter et al. 2007, equation 33; Heitz 2014, equation 84.
    """
    alpha_x, alpha_y = (np.asarray(a, normals.dtype) for a in (alpha_x, alpha_y))
    x, y, z = (normals[..., k] for k in range(3))
    # In this form nothing is subtracted, so that narrow lobes are exact in float32.
    length = x * x + y * y + z * z
    across, up = x * (1 / alpha_x), y * (1 / alpha_y)
    stretched = across * across + up * up + z * z
    ratio = length / np.maximum(stretched, np.finfo(normals.dtype).tiny)
    return ratio * ratio * (1 / (normals.dtype.type(np.pi) * alpha_x * alpha_y))


def _unit(x, y, z):
    """x, y, z of vectors at length 1; those of length zero point up."""
    length = np.sqrt(x * x + y * y + z * z)
    scale = 1 / np.where(length > 0, length, 1)
    return x * scale, y * scale, np.where(length > 0, z * scale, 1)


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
