"""Tables of what a GGX lobe reflects in all: made when they are first asked for.

They have the nodes that Cycles' have, and are interpolated as there, so that lobes are scaled by
the same factors. Sums are over normals as a viewer sees them, half of them: the other half mirrors
it. Made in a second, kept for the process.

Source: Kulla and Conty 2017, Revisiting physically based shading at Imageworks; Turquin 2019,
Practical multiple scattering compensation for microfacet models.
"""

from functools import lru_cache

import numpy as np

from prt_core.reflectance.fresnel import dielectric, f0_of_ior
from prt_core.reflectance.fresnel_powers import powers_at
from prt_core.sphere import square_to_ggx_normals

# Nodes of a table along roughness and cosine, and those of Fresnel terms besides.
_N, _N_FRESNEL = 32, 16
# Normals that are summed over: rings, and places along half of each.
_RINGS, _PLACES = 64, 32
_LEAST = 1e-4


def ggx_albedo(roughness, cosine):
    """The share of even light that a white GGX lobe of one bounce sends towards a viewer.

    Parameters
    ----------
    roughness : (...) float
        Root of alpha, 0 to 1.
    cosine : (...) float
        Between viewer and normal, 0 to 1.

    Returns
    -------
    (...) array
    """
    return _read(_albedo(), roughness, cosine)


def ggx_mean_albedo(roughness):
    """`ggx_albedo` in the mean over all directions, weighted by the cosine: (...) of roughness."""
    return _read(_mean_albedo(), roughness)


def ggx_fresnel_share(roughness, cosine, ior):
    """How far a GGX lobe's albedo is on the way from F0 to white, for a dielectric's curve.

    Parameters
    ----------
    roughness, cosine : (...) float
        See `ggx_albedo`.
    ior : (...) float
        Relative index of refraction.

    Returns
    -------
    (...) array
    """
    return _read(_fresnel_share(), np.sqrt(np.abs((ior - 1) / (ior + 1))), roughness, cosine)


def ggx_power_albedos(roughness, cosines):
    """What white lobes times powers of the Fresnel term send towards a viewer, of even light.

    Worked out, not looked up.

    Parameters
    ----------
    roughness : float
        Root of alpha, above 0 to 1.
    cosines : (n,) float
        Between viewer and normal, above 0 to 1.

    Returns
    -------
    (n, N_POWERS) array
        See `fresnel_powers`.
    """
    share, facing = _reflected(roughness, np.asarray(cosines, np.float64))
    return np.stack([_sums(share * power) for power in powers_at(facing)], axis=1)


@lru_cache(maxsize=1)
def _albedo():
    """(32, 32) by roughness and cosine."""
    nodes = np.clip(np.linspace(0, 1, _N), _LEAST, 1)
    return np.stack([_sums(_reflected(rough, nodes)[0]) for rough in nodes])


@lru_cache(maxsize=1)
def _mean_albedo():
    """(32,) by roughness."""
    places, weights = np.polynomial.legendre.leggauss(24)
    cosines, weights = (places + 1) / 2, weights * (places + 1) / 2
    nodes = np.clip(np.linspace(0, 1, _N), _LEAST, 1)
    return np.stack([_sums(_reflected(rough, cosines)[0]) @ weights for rough in nodes])


@lru_cache(maxsize=1)
def _fresnel_share():
    """(16, 16, 16) by index of refraction, roughness and cosine."""
    nodes = np.clip(np.linspace(0, 1, _N_FRESNEL), _LEAST, 1)
    root = np.minimum(nodes, 0.99) ** 2
    iors = ((1 + root) / (1 - root)).reshape(-1, 1, 1)
    f0, result = f0_of_ior(iors), []
    for rough in nodes:
        share, facing = _reflected(rough, nodes)
        value = np.clip((dielectric(facing, iors) - f0) / (1 - f0), 0, 1)
        result.append(_sums(value * (share > 0)))
    return np.stack(result, axis=1)


def _reflected(roughness, cosines):
    """Shares of light that normals mirror past other facets, and their cosines: (n, n_normals)."""
    alpha = roughness**2
    # Rings are closer where normals turn away from the viewer.
    u, v = np.meshgrid(1 - (1 - _middles(_RINGS)) ** 2, _middles(_PLACES) / 2 - 0.25)
    uv = np.stack([u.ravel(), v.ravel()], axis=-1)
    outgoing = np.stack([np.sqrt(1 - cosines**2), 0 * cosines, cosines], axis=-1)[:, None]
    normals = square_to_ggx_normals(uv, outgoing, alpha, alpha)
    facing = np.minimum((normals * outgoing).sum(axis=-1), 1)
    height = 2 * facing * normals[..., 2] - outgoing[..., 2]
    there = height > 0
    height = np.where(there, height, 1)
    own, other = (
        np.sqrt(1 + alpha**2 * np.maximum(1 / z**2 - 1, 0)) for z in (outgoing[..., 2], height)
    )
    return np.where(there, (1 + own) / (own + other), 0), facing


def _middles(n):
    return (np.arange(n) + 0.5) / n


def _sums(values):
    """(...) of values (..., n_normals) of `_reflected`, each with its share of all normals."""
    weights = np.tile(2 * (1 - _middles(_RINGS)), _PLACES)
    return values @ (weights / weights.sum())


def _read(table, *places):
    """A table between its nodes, linearly, at (...) places from 0 to 1 along each axis."""
    result, lower = [], []
    for place, n in zip(places, table.shape, strict=True):
        place = np.clip(place, 0, 1) * (n - 1)
        low = np.minimum(place.astype(np.int64), n - 2)
        lower.append((low, place - low))
    result = 0.0
    for corner in np.ndindex(*(2,) * len(lower)):
        weight, index = 1.0, []
        for step, (low, share) in zip(corner, lower, strict=True):
            weight = weight * (share if step else 1 - share)
            index.append(low + step)
        result = result + weight * table[tuple(index)]
    return result
