"""Materials of a .glb: base colours and opacity where a surface has one of them."""

import numpy as np

from prt_core.scene import ended_at

# How far a quantity may vary over a surface that is still said to have one value.
_EVEN = 1e-3
_UNLIT = "KHR_materials_unlit"


def material_of(name, materials, multiplied):
    """The glTF material of a surface, and what of it is lost.

    Parameters
    ----------
    name : str
    materials : Materials
        Of its vertices.
    multiplied : bool
        Whether the colours are light, to be multiplied with the base colour; else they are shown.

    Returns
    -------
    dict
    str
        What is to be said, empty where all of it is told.
    ended : (n,) float32
        By which colours of all the light that arrives are divided: they are blended by opacity.
    """
    lost, factor, opacity, ended = "", np.ones(3), 1.0, np.ones(len(materials), np.float32)
    if (materials.opacity < 1 - _EVEN).any():
        (opacity,), is_even = _one_value(materials.opacity)
        if is_even:
            ended = ended_at(materials)
        else:
            opacity, lost = 1.0, "opacity"
    if multiplied:
        factor, is_even = _one_value(materials.front / ended[:, None])
        if not is_even:
            # A texture takes its place, that the user has and the bake has not.
            factor, lost = np.ones(3), "base colour and opacity" if lost else "base colour"
    material = {
        "name": name,
        "doubleSided": True,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*np.clip(factor, 0, 1).tolist(), float(np.clip(opacity, 0, 1))],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        },
        # What an engine's lights would add is in the colours already.
        "extensions": {_UNLIT: {}},
    }
    if opacity < 1:
        material["alphaMode"] = "BLEND"
    return material, lost, ended


def _one_value(values):
    """Mean over places, (n_channels,) float64, and whether it is nearly that of each."""
    mean = values.mean(axis=0, dtype=np.float64)
    return mean, bool((np.ptp(values, axis=0) <= 2 * _EVEN).all())
