"""What Cycles' passes mean: albedo, emission, opacity, translucency and shading normals.

Metal has no diffuse colour; until gloss is baked its specular one stands in for it, for black would
be worse. The few per cent that dielectrics reflect do not. Nor has glass, which is shown by what it
lets through.
"""

import numpy as np

from prt_core.reflectance import QUANTITIES

# Columns of one sample.
COLUMNS = {
    "albedo": slice(0, 3),
    "emission": slice(3, 6),
    "opacity": slice(6, 7),
    "translucency": slice(7, 10),
    "transmission": slice(10, 13),
    "normal": slice(13, 16),
    "bump": slice(16, 17),
}
N_COLUMNS = 17
# Colourless specular reflection seen from straight on, over a diffuse colour and over none: as a
# dielectric may have it, and for certain more.
_OVER, _BARE = (0.2, 0.3), (0.085, 0.1)
# What has no more diffuse colour than this would be black: it is shown by what it lets through.
_GLASS = 0.05
# Below this a pass is taken to be empty.
_NOTHING = 2e-3
# A thousandth of what an eye tells apart: another machine's last bits shall not be another surface.
_STEPS = 4096

LINES = {
    "metal": "metal; until gloss is baked, its specular reflection counts as diffuse",
    "specular": "specular reflection is ignored, the diffuse colour is baked",
    "glass": "glass is taken as thin; light goes straight through, as grey as its colour, and what "
    "has no other colour is shown as a glow of that one",
    "tinted": "coloured transparency lets light of all colours through alike",
    "rough": "diffuse roughness is ignored, light leaves evenly to all sides",
    "scatters": "subsurface scattering counts as diffuse",
    "toon": "toon shading is ignored, light leaves evenly to all sides",
    "bumpy": "bump is left out, as in Cycles' own bakes; use a normal map, or displace the mesh",
    "lengths": "Light Path: lengths and depths are those of a ray of length 1 after one bounce",
    "sampled": "Light Path: its emission is that of diffuse rays; Cycles also takes other rays'",
    "sides": "Light Path: to shadow rays its back is as its front",
    "holdouts": "a holdout is black to light; renders have a hole there, pictures of a bake do not",
    "views": "Layer Weight, Fresnel, Incoming and the like: it is as seen from straight on",
    "fine normals": "the normal map is finer than the mesh and counts at its points only; "
    "subdivide the mesh to see it",
    "coarse": "has more detail than was sampled between the corners",
}


def quantities_of(passes, plain=None):
    """(n, 17) float32 of what was rendered, by `COLUMNS`.

    Parameters
    ----------
    passes : dict of str -> array
        See `Probe.look`.
    plain : (n, 3) float32, optional
        The diffuse pass without translucent shaders; the rest of it is translucency.

    Returns
    -------
    values : (n, 17) float32
    signs : dict of str -> (n,) bool
        Where there is metal, specular reflection and glass, by the keys of `LINES`.
    """
    values = np.zeros((len(passes["share"]), N_COLUMNS), np.float32)
    diffuse, glossy, through = (
        np.nan_to_num(passes[k]) for k in ("diffuse", "glossy", "transmission")
    )
    metal = _metal(diffuse, glossy, through)
    translucency = np.zeros_like(diffuse) if plain is None else np.maximum(diffuse - plain, 0)
    values[:, COLUMNS["albedo"]] = diffuse - translucency + metal
    values[:, COLUMNS["translucency"]] = translucency
    values[:, COLUMNS["opacity"]] = (passes["share"] - through.mean(axis=1))[:, None]
    most = diffuse.max(axis=1, keepdims=True)
    values[:, COLUMNS["transmission"]] = through * np.clip(1 - most / _GLASS, 0, 1)
    values[:, COLUMNS["normal"]] = passes["normal"]
    steps = np.round(values * _STEPS) / _STEPS
    emission = np.maximum(np.nan_to_num(passes["emission"], posinf=0), 0)
    mantissa, exponent = np.frexp(emission)
    steps[:, COLUMNS["emission"]] = np.ldexp(np.round(mantissa * _STEPS) / _STEPS, exponent)
    return steps, {
        "metal": metal.max(axis=1) > _NOTHING,
        "specular": (glossy - metal).max(axis=1) > 5 * _NOTHING,
        "glass": through.max(axis=1) > _NOTHING,
        "tinted": np.ptp(through, axis=1) > 0.05,
    }


def _metal(diffuse, glossy, through):
    """(n, 3) what metal has of the glossy pass.

    Metal reflects in the base colour, which the diffuse pass shows where there is less than all of
    it; the rest is colourless, and a dielectric's unless there is too much of it.
    """
    most = diffuse.max(axis=1, keepdims=True)
    colour = np.where(most > 0.01, diffuse / np.maximum(most, 1e-9), glossy)
    spread = np.ptp(colour, axis=1)
    coloured = (most[:, 0] > 0.01) & (spread > 0.1)
    share = np.where(coloured, np.ptp(glossy, axis=1) / np.maximum(spread, 1e-9), 0)
    # It must be the same colour, or there is no such metal.
    share = np.minimum(share, (glossy / np.maximum(colour, 1e-3)).min(axis=1))[:, None]
    rest = glossy - share * colour
    bare = (most[:, 0] < 0.01) & (through.max(axis=1) < _NOTHING)
    low, high = np.where(bare[:, None], _BARE, _OVER).T
    weight = np.clip((rest.max(axis=1) - low) / (high - low), 0, 1)
    return share * colour + weight[:, None] * rest


def settled(values):
    """`values` within their ranges, and whether an albedo was not."""
    albedo = values[:, COLUMNS["albedo"]]
    outside = bool((albedo > QUANTITIES["albedo"].most).any() or (albedo < -1e-3).any())
    for name in ("albedo", "opacity", "translucency", "transmission"):
        part = values[:, COLUMNS[name]]
        np.clip(part, 0, QUANTITIES[name].most, out=part)
    return values, outside


def lines_of(notes):
    """Messages of notes (kind, name of a material), or ("line", a whole message)."""
    lines = [
        name if kind == "line" else f"material '{name}': {LINES[kind]}"
        for kind, name in notes
        if name
    ]
    return list(dict.fromkeys(lines))
