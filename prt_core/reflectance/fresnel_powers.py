"""Fresnel terms as sums of four powers, so that all lobes of a roughness are evaluated together.

Of the cosine c between light and facet: 1, (1 - c)^5, (1 - c)^2, and c (1 - c)^6. Constants and
metals are such sums; the curve of a dielectric is fitted with the first three. (For glass the
square leaves a third of the error of the cube.)
"""

from functools import lru_cache

import numpy as np

from prt_core.errors import PRTError
from prt_core.reflectance.fresnel import (
    Constant,
    Dielectric,
    F82Tint,
    RealSchlick,
    dielectric,
    f0_of_ior,
)

N_POWERS = 4
# Steps of the index of refraction between which curves are taken to be the same.
_STEP = 1 / 64


def fresnel_powers(term):
    """The powers of a Fresnel term.

    Parameters
    ----------
    term : Constant, F82Tint, RealSchlick or Dielectric
        Its parameters (n, 1), its colours (n, 1, n_channels), or what broadcasts to that.

    Returns
    -------
    (n, N_POWERS, 3) float64

    Raises
    ------
    PRTError
        It is another term.
    """
    if isinstance(term, Constant):
        zero = 0 * term.colour
        parts = term.colour, zero, zero, zero
    elif isinstance(term, F82Tint):
        parts = term.f0, term.weight - term.f0, 0 * term.f0, -term.dip
    elif isinstance(term, RealSchlick):
        share, way = _shares(term.ior), term.f90 - term.f0
        parts = term.f0, way * share[..., :1], way * share[..., 1:], 0 * way
    elif isinstance(term, Dielectric):
        f0 = f0_of_ior(term.ior)[..., None]
        share = _shares(term.ior) * (1 - f0)
        parts = f0, share[..., :1], share[..., 1:], 0 * f0
    else:
        raise PRTError(f"fresnel: expected a known term, got {type(term).__name__}")
    n = max(part.shape[0] if part.ndim > 1 else 1 for part in parts)
    parts = [np.broadcast_to(part, (n, 1, 3))[:, 0] for part in parts]
    return np.stack(parts, axis=1)


def powers_at(cosine):
    """The powers themselves.

    Parameters
    ----------
    cosine : (...) float
        Between light and facet.

    Returns
    -------
    tuple of N_POWERS (...) arrays
    """
    rest = np.clip(1 - cosine, 0, 1)
    square = rest * rest
    fifth = square * square * rest
    return np.ones_like(rest), fifth, square, cosine * rest * fifth


def powers_used(powers):
    """How many powers any of some terms (n, N_POWERS, 3) has, counted from the first."""
    return 1 + int(np.flatnonzero(powers.any(axis=(0, 2))).max(initial=0))


def _shares(ior):
    """(..., 2): the way from F0 to white of a dielectric's curve, in powers; of `ior` (...)."""
    step = np.rint(np.asarray(ior, np.float64) / _STEP).astype(np.int64)
    known, which = np.unique(step, return_inverse=True)
    table = np.array([_fitted(int(each)) for each in known]).reshape(-1, 2)
    return table[which.ravel()].reshape(*step.shape, 2)


@lru_cache(maxsize=4096)
def _fitted(step):
    """The powers of the curve of an index of refraction, in least squares over the hemisphere."""
    ior = max(step * _STEP, 1e-5)
    if step == round(1 / _STEP):
        return 0.0, 0.0
    cosine = (np.arange(512) + 0.5) / 512
    f0 = f0_of_ior(ior)
    way = (dielectric(cosine, ior) - f0) / (1 - f0)
    rest = 1 - cosine
    # In parts of what is reflected: most facets are seen at moderate angles.
    weight = np.sqrt(cosine) / (f0 + way * (1 - f0))
    powers = np.stack([rest**5, rest**2], axis=1)
    return tuple(np.linalg.lstsq(powers * weight[:, None], way * weight, rcond=None)[0])
