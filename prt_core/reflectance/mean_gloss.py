"""What gloss sends in the mean of all views, where no view is known: bounces, and reflections.

A layer reflects several per cent of the light before it reaches what is below; seen from aslant it
reflects more, and lets less through. What is below is measured from straight above, so both are
missing in the light that a surface throws on others, of which this is the mean.
"""

from functools import lru_cache

import numpy as np

from prt_core.reflectance.energy import ggx_power_albedos
from prt_core.reflectance.fresnel_powers import fresnel_powers
from prt_core.reflectance.principled import GLOSSY_LOBES, principled_lobes
from prt_core.reflectance.view_factors import ViewFactors
from prt_core.runtime.threads import on_all_cores

# Sliders of roughness, and cosines of views, at which lobes are summed.
_SLIDERS, _COSINES = np.linspace(0.1, 1, 10), 10
_GLOSS = ("glossy", "metal", "dielectric", "coat")


def with_mean_gloss(materials):
    """Materials whose albedo is all that they send, in the mean of all views.

    What that is more than before is in `stand_in` as well.

    Parameters
    ----------
    materials : Materials
        Of n points.

    Returns
    -------
    Materials
        The same object where nothing has gloss.
    """
    more = more_by_gloss(materials)
    if not more.any():
        return materials
    given = {name: np.asarray(getattr(materials, name)) for name in ("albedo", "stand_in")}
    return materials.replaced(
        **{name: (values + more).astype(values.dtype) for name, values in given.items()}
    )


def more_by_gloss(materials):
    """What materials send in the mean of all views, beyond their albedo.

    Parameters
    ----------
    materials : Materials
        Of n points.

    Returns
    -------
    (n, 3) float32
        Of the light that they receive; below 0 where a colour stands in for more than there is.
    """
    more = np.zeros((len(materials), 3), np.float32)
    glossy = np.zeros(len(materials), bool)
    for name in _GLOSS:
        glossy |= np.any(np.asarray(getattr(materials, name)) > 0, axis=1)
    rows = np.flatnonzero(glossy)
    if len(rows):
        # What is truly diffuse stays so.
        more[rows] = np.maximum(_more(materials[rows]), -np.asarray(materials.stand_in)[rows])
    return more


def _more(materials):
    """(n, 3): what materials send in the mean of all views, without their albedo."""
    factors = ViewFactors(materials)
    _, first, kind = np.unique(factors.kind, return_index=True, return_inverse=True)
    own = materials[first]
    lobes, n = principled_lobes(own), len(first)
    cosines, weights = _views()
    places = np.repeat(first, len(cosines)), np.tile(cosines, n)
    shape = n, len(cosines), 3
    seen = {name: each.reshape(shape) for name, each in factors.at(*places).items()}
    diffuse = np.maximum(np.asarray(own.albedo) - np.asarray(own.stand_in), 0)
    total = diffuse[:, None] * seen["diffuse"]
    for lobe in lobes.lobes:
        if lobe.name in GLOSSY_LOBES:
            powers = fresnel_powers(lobe.reflectance.fresnel) * lobe.weight
            alpha = np.sqrt(lobe.reflectance.alpha_x * lobe.reflectance.alpha_y)[:, 0]
            white = _white(np.sqrt(alpha))
            powers = np.broadcast_to(powers, (len(white), *powers.shape[1:]))
            share = np.einsum("ncp,npx->ncx", white, powers)
            total[lobe.rows] += share * seen[lobe.name][lobe.rows]
    mean = np.einsum("ncx,c->nx", total, weights)
    return (mean - np.asarray(own.albedo))[kind.ravel()]


def _white(slider):
    """(n, n_cosines, N_POWERS): what white lobes of sliders (n,) reflect of even light."""
    place = np.clip((slider - _SLIDERS[0]) / (_SLIDERS[1] - _SLIDERS[0]), 0, len(_SLIDERS) - 1)
    low = np.minimum(place.astype(np.int64), len(_SLIDERS) - 2)
    part, table = (place - low)[:, None, None], _table()
    return table[low] * (1 - part) + table[low + 1] * part


@lru_cache(maxsize=1)
def _table():
    cosines, _ = _views()
    return np.stack(on_all_cores(lambda slider: ggx_power_albedos(slider, cosines), _SLIDERS))


@lru_cache(maxsize=1)
def _views():
    """Cosines of views, and weights: their mean over the hemisphere, each by its cosine."""
    places, weights = np.polynomial.legendre.leggauss(_COSINES)
    cosines = (places + 1) / 2
    return cosines, weights * cosines
