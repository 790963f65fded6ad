"""What Cycles' passes mean: albedo, emission, opacity, translucency and shading normals.

Metal has no diffuse colour; until gloss is baked its specular one stands in for it, for black would
be worse. The few per cent that dielectrics reflect do not. Nor has glass, which is shown by what it
lets through.
"""

import numpy as np

from prt_core.reflectance import QUANTITIES

# What is known of gloss where it is asked for.
GLOSS = (
    "stand_in", "glossy", "metal", "metal_edge", "dielectric", "tint", "ior", "roughness",
    "anisotropy", "tangent", "single", "coat", "coat_roughness", "coat_ior", "coat_tint",
    "diffuse_roughness",
)  # fmt: skip


def _columns():
    """Name -> columns of one sample; those of gloss come last, and are there where it is."""
    sizes = {name: QUANTITIES[name].n_channels for name in GLOSS}
    sizes = {"albedo": 3, "emission": 3, "opacity": 1, "translucency": 3, "transmission": 3,
             "normal": 3, "bump": 1} | sizes  # fmt: skip
    starts = np.cumsum([0, *sizes.values()]).tolist()
    return {
        name: slice(start, start + size)
        for (name, size), start in zip(sizes.items(), starts, strict=False)
    }


COLUMNS = _columns()
DIRECTIONS = {"normal", "tangent"}
# Without those of gloss, and all.
N_COLUMNS, N_GLOSSY_COLUMNS = COLUMNS["bump"].stop, COLUMNS[GLOSS[-1]].stop
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
    "portals": "a Ray Portal leads nowhere; light goes straight through it",
    "bumpy": "bump is left out, as in Cycles' own bakes; use a normal map, or displace the mesh",
    "lengths": "Light Path: lengths and depths are those of a ray of length 1 after one bounce",
    "sampled": "Light Path: its emission is that of diffuse rays; Cycles also takes other rays'",
    "takes": "emission below zero takes no light away; it is none",
    "sides": "Light Path: to shadow rays its back is as its front",
    "holdouts": "a holdout is black to light; renders have a hole there, pictures of a bake do not",
    "views": "Layer Weight, Fresnel, Incoming and the like: it is as seen from straight on",
    "fine normals": "the normal map is finer than the mesh and counts at its points only; "
    "subdivide the mesh to see it",
    "coarse": "has more detail than was sampled between the corners",
}
# What is said otherwise where gloss is baked.
GLOSS_LINES = {
    "metal": "metal; its reflections are shown to the view, in bounces they count as diffuse",
    "specular": None,
    "glows below": "what its coat takes from the light that it emits is as seen from straight on",
    "rough": "its diffuse roughness is that of light of lamps, as seen from straight above; light "
    "of the sky leaves evenly to all sides",
}


def quantities_of(passes, plain=None):
    """(n, N_COLUMNS) float32 of what was rendered, by `COLUMNS`.

    Parameters
    ----------
    passes : dict of str -> array
        See `Probe.look`.
    plain : (n, 3) float32, optional
        The diffuse pass without translucent shaders; the rest of it is translucency.

    Returns
    -------
    values : (n, N_COLUMNS) float32
    signs : dict of str -> (n,) bool
        Where there is metal, specular reflection, glass and the like, by the keys of `LINES`.
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
    given = np.nan_to_num(passes["emission"], posinf=0)
    emission = np.maximum(given, 0)
    mantissa, exponent = np.frexp(emission)
    steps[:, COLUMNS["emission"]] = np.ldexp(np.round(mantissa * _STEPS) / _STEPS, exponent)
    return steps, {
        "metal": metal.max(axis=1) > _NOTHING,
        "specular": (glossy - metal).max(axis=1) > 5 * _NOTHING,
        "glass": through.max(axis=1) > _NOTHING,
        "tinted": np.ptp(through, axis=1) > 0.05,
        "takes": given.min(axis=1) < -_NOTHING,
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


def stand_in_of(passes):
    """(n, 3) float32: what `quantities_of` takes for diffuse of what is not."""
    diffuse, glossy, through = (
        np.nan_to_num(passes[k]) for k in ("diffuse", "glossy", "transmission")
    )
    return np.round(_metal(diffuse, glossy, through) * _STEPS) / _STEPS


def columns_of(n_columns):
    """Those `COLUMNS` that samples of so many have."""
    return {name: part for name, part in COLUMNS.items() if part.stop <= n_columns}


def compared(values):
    """Samples (..., n_columns) by which surfaces are told apart: without directions and `bump`."""
    looks = values.copy()
    known = columns_of(values.shape[-1])
    for name in {*DIRECTIONS, "bump"} & set(known):
        looks[..., COLUMNS[name]] = 0
    for name in {"ior", "coat_ior"} & set(known):
        # As what they reflect, between 0 and 1.
        looks[..., COLUMNS[name]] = 1 / looks[..., COLUMNS[name]]
    return looks


def default_columns(n_columns, grey=0.8):
    """(n_columns,) float32: a sample of a grey surface that reflects evenly to all sides."""
    sample = np.zeros(n_columns, np.float32)
    sample[COLUMNS["albedo"]], sample[COLUMNS["opacity"]] = grey, 1
    for name in set(GLOSS) & set(columns_of(n_columns)):
        sample[COLUMNS[name]] = QUANTITIES[name].default
    return sample


def settled(values):
    """`values` within their ranges, and whether an albedo was not."""
    albedo = values[:, COLUMNS["albedo"]]
    outside = bool((albedo > QUANTITIES["albedo"].most).any() or (albedo < -1e-3).any())
    limited = {"albedo", "opacity", "translucency", "transmission", *GLOSS} - {"tangent"}
    for name in limited & set(columns_of(values.shape[1])):
        part = values[:, COLUMNS[name]]
        np.clip(part, QUANTITIES[name].least, QUANTITIES[name].most, out=part)
    return values, outside


def lines_of(notes, gloss=False):
    """Messages of notes (kind, name of a material), or ("line", a whole message).

    `gloss` : bool
        Whether it was evaluated.
    """
    texts = {**LINES, **GLOSS_LINES} if gloss else LINES
    lines = [
        name if kind == "line" else f"material '{name}': {texts[kind]}"
        for kind, name in notes
        if name and (kind == "line" or texts[kind])
    ]
    return list(dict.fromkeys(lines))
