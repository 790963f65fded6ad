"""What the sums over closures mean (see `closures.PLANES`): the quantities of glossy surfaces."""

import numpy as np

from prt_core.blender.passes.quantities import (
    COLUMNS,
    N_COLUMNS,
    N_GLOSSY_COLUMNS,
    default_columns,
    stand_in_of,
)
from prt_core.reflectance import QUANTITIES

# Lobes that reflect less of even light are none.
_NOTHING = 1e-4
# Roughnesses of a place that differ by more, about their mean, are two.
_APART = 0.15
_LEAST_ANISOTROPY = 1e-3
_LEAST_F0, _MOST_F0 = 1e-6, 0.99
_STEPS = 4096


def with_gloss(values, passes):
    """Samples that know of gloss as well.

    Parameters
    ----------
    values : (n, N_COLUMNS) float32
        See `quantities_of`.
    passes : dict of str -> array
        Of which they were made; "gloss" is a dict of planes, (n, 3) float32 each.

    Returns
    -------
    values : (n, N_GLOSSY_COLUMNS) float32
    signs : dict of str -> (n,) bool
        By the keys of `LINES`.
    """
    whole = np.tile(default_columns(N_GLOSSY_COLUMNS), (len(values), 1))
    whole[:, :N_COLUMNS] = values
    stand_in = np.minimum(stand_in_of(passes), values[:, COLUMNS["albedo"]])
    whole[:, COLUMNS["stand_in"]] = stand_in
    sums = {
        name: np.nan_to_num(plane.astype(np.float64)) for name, plane in passes["gloss"].items()
    }
    if "glossy" in sums:
        _put(whole, "glossy", sums["glossy"], np.ones(len(values), bool))
    if "weights" in sums:
        _put_weights(whole, sums)
    if "coat" in sums:
        _put_coat(whole, sums)
    if "others" in sums:
        _, diffuse, rough = sums["others"].T
        _put(whole, "diffuse_roughness", _ratio(rough, diffuse), diffuse > _NOTHING)
    return whole, _put_roughness(whole, sums) if "rough" in sums else {}


def _put_weights(values, sums):
    of_metal, of_dielectric, f0 = sums["weights"].T
    metal = of_metal > _NOTHING
    _put(values, "metal", sums.get("metal", 0 * sums["weights"]), metal)
    f0 = _ratio(f0, of_dielectric)
    body = (of_dielectric > _NOTHING) & (f0 > _LEAST_F0)
    _put(values, "dielectric", of_dielectric, body)
    _put(values, "ior", _ior(f0), body)
    if "edge" in sums:
        _put(values, "metal_edge", 1 - _ratio(sums["edge"], of_metal), metal)
    if "tint" in sums:
        _put(values, "tint", 1 - _ratio(sums["tint"], of_dielectric), body)


def _put_roughness(values, sums):
    reflected, rough, square = sums["rough"].T
    mean, shiny = _ratio(rough, reflected), reflected > _NOTHING
    signs = {}
    _put(values, "roughness", mean, shiny)
    if "single" in sums:
        _put(values, "single", _ratio(sums["single"][:, 0], reflected), shiny)
    if "tangent" in sums:
        anisotropy = _ratio(sums["others"][:, 0], reflected)
        # What Cycles takes of a tangent lies in the surface.
        normals, tangent = values[:, COLUMNS["normal"]].astype(np.float64), sums["tangent"]
        tangent = tangent - np.einsum("nx,nx->n", tangent, normals)[:, None] * normals
        length = np.linalg.norm(tangent, axis=1)
        stretched = shiny & (anisotropy > _LEAST_ANISOTROPY)
        lying = stretched & (length > 1e-9)
        signs["no tangent"] = stretched & ~lying
        _put(values, "anisotropy", anisotropy, lying)
        _put(values, "tangent", tangent / np.maximum(length, 1e-30)[:, None], lying)
    spread = np.sqrt(np.maximum(_ratio(square, reflected) - mean**2, 0))
    return signs | {"roughnesses": shiny & (spread > _APART)}


def _put_coat(values, sums):
    coat, rough, f0 = sums["coat"].T
    coated = coat > _NOTHING
    _put(values, "coat", coat, coated)
    _put(values, "coat_roughness", _ratio(rough, coat), coated)
    _put(values, "coat_ior", _ior(_ratio(f0, coat)), coated)
    if "coat_tint" in sums:
        _put(values, "coat_tint", 1 - _ratio(sums["coat_tint"], coat), coated)


def _put(values, name, given, where):
    """Set a quantity at places; another machine's last bits shall not be another surface."""
    quantity = QUANTITIES[name]
    if not where.any():
        return
    given = np.clip(given.reshape(len(values), -1)[where], quantity.least, quantity.most)
    stepped = np.round(given * _STEPS) / _STEPS
    usual = np.abs(given - quantity.default) < 0.5 / _STEPS
    values[where, COLUMNS[name]] = np.where(usual, quantity.default, stepped)


def _ior(f0):
    root = np.sqrt(np.clip(f0, 0, _MOST_F0))
    return (1 + root) / (1 - root)


def _ratio(sums, weights):
    """Sums (n, ...) by weights (n,); 0 where there are none."""
    weights = weights.reshape(-1, *[1] * (sums.ndim - 1))
    return np.where(weights > 1e-12, sums / np.maximum(weights, 1e-12), 0)
