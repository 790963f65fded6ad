"""What Cycles' passes mean: albedo, emission, opacity, translucency and shading normals.

Metal has no diffuse colour; until gloss is baked its specular one stands in for it, for black would
be worse. The few per cent that dielectrics reflect do not.
"""

import numpy as np

# Columns of one sample.
COLUMNS = {
    "albedo": slice(0, 3),
    "emission": slice(3, 6),
    "opacity": slice(6, 7),
    "translucency": slice(7, 10),
    "normal": slice(10, 13),
    "bump": slice(13, 14),
}
N_COLUMNS = 14
# Specular reflection seen from straight on: no more than a dielectric's, and metal for certain.
_DIELECTRIC, _METAL = 0.085, 0.17
# Below this a pass is taken to be empty.
_NOTHING = 2e-3
# A thousandth of what an eye tells apart: another machine's last bits shall not be another surface.
_STEPS = 4096

LINES = {
    "metal": "metal; until gloss is baked, its specular reflection counts as diffuse",
    "specular": "specular reflection is ignored, the diffuse colour is baked",
    "glass": "glass is taken as thin; light goes straight through, as grey as its colour",
    "tinted": "coloured transparency lets light of all colours through alike",
    "rough": "diffuse roughness is ignored, light leaves evenly to all sides",
    "scatters": "subsurface scattering counts as diffuse",
    "bumpy": "bump is left out, as in Cycles' own bakes; use a normal map, or displace the mesh",
    "paths": "Light Path nodes answer as for rays of the camera",
    "backs": "what asks for Backfacing is answered for the front",
    "fine normals": "the normal map is finer than the mesh and counts at its points only; "
    "subdivide the mesh to see it",
    "coarse": "has more detail than was sampled between the corners",
}


def quantities_of(passes, plain=None):
    """(n, 14) float32 of what was rendered, by `COLUMNS`.

    Parameters
    ----------
    passes : dict of str -> array
        See `Probe.look`.
    plain : (n, 3) float32, optional
        The diffuse pass without translucent shaders; the rest of it is translucency.

    Returns
    -------
    values : (n, 14) float32
    signs : dict of str -> (n,) bool
        Where there is metal, specular reflection and glass, by the keys of `LINES`.
    """
    values = np.zeros((len(passes["share"]), N_COLUMNS), np.float32)
    diffuse, glossy, through = (
        np.nan_to_num(passes[k]) for k in ("diffuse", "glossy", "transmission")
    )
    peak = glossy.max(axis=1)
    metal = np.clip((peak - _DIELECTRIC) / (_METAL - _DIELECTRIC), 0, 1)
    translucency = np.zeros_like(diffuse) if plain is None else np.maximum(diffuse - plain, 0)
    values[:, COLUMNS["albedo"]] = diffuse - translucency + metal[:, None] * glossy
    values[:, COLUMNS["translucency"]] = translucency
    values[:, COLUMNS["opacity"]] = (passes["share"] - through.mean(axis=1))[:, None]
    values[:, COLUMNS["normal"]] = passes["normal"]
    steps = np.round(values * _STEPS) / _STEPS
    emission = np.maximum(np.nan_to_num(passes["emission"], posinf=0), 0)
    mantissa, exponent = np.frexp(emission)
    steps[:, COLUMNS["emission"]] = np.ldexp(np.round(mantissa * _STEPS) / _STEPS, exponent)
    return steps, {
        "metal": metal > 0,
        "specular": (peak > _NOTHING) & (metal == 0),
        "glass": through.max(axis=1) > _NOTHING,
        "tinted": np.ptp(through, axis=1) > 0.05,
    }


def settled(values):
    """`values` within their ranges, and whether an albedo was not."""
    albedo = values[:, COLUMNS["albedo"]]
    outside = bool((albedo > 1 + 1e-3).any() or (albedo < -1e-3).any())
    for name in ("albedo", "opacity", "translucency"):
        part = values[:, COLUMNS[name]]
        np.clip(part, 0, 1, out=part)
    return values, outside


def lines_of(notes):
    """Messages of notes (kind, name of a material), or ("line", a whole message)."""
    lines = [
        name if kind == "line" else f"material '{name}': {LINES[kind]}"
        for kind, name in notes
        if name
    ]
    return list(dict.fromkeys(lines))
