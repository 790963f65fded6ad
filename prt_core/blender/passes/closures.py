"""What the closures of Blender's shaders reflect, as sums over lobes.

Cycles evaluates what goes into these sums; `gloss.py` reads what they mean. A sum is three numbers
by the name of its plane (`PLANES`). Source of each closure's meaning: Cycles, `svm/closure.h`.
"""

import numpy as np

from prt_core.blender.passes.arithmetic import is_socket

# Sums over lobes, w being the weight of a lobe and L about how much of even light it reflects.
PLANES = {
    "glossy": "w x colour of lobes that have the same Fresnel from all sides",
    "metal": "w x F0 of metal lobes",
    "edge": "w x (1 - F82 tint) of metal lobes",
    "tint": "w x (1 - tint) of dielectric lobes",
    "weights": "w of metal; w, and w x F0, of dielectrics",
    "rough": "L; L x roughness; L x roughness^2",
    "tangent": "L x anisotropy x tangent",
    "single": "as rough, of facets between which light does not bounce",
    "others": "L x anisotropy; w, and w x roughness, of diffuse reflection",
    "coat": "w; w x roughness; w x F0 of coats",
    "coat_tint": "w x (1 - tint) of coats",
}
# Schlick's Fresnel of even light is F0 + (1 - F0) / 21.
_SCHLICK = 1 / 21
# Where metals' edges are tinted: the cosine, and Schlick's weight of white there.
_EDGE = 1 / 7
_EDGE_WHITE = (1 - _EDGE) ** 5


class Sums(dict):
    """Name of a plane -> value; a plane that is missing is 0."""

    def add(self, arithmetic, name, value):
        """Add to a plane."""
        if is_socket(value) or np.any(value):
            self[name] = arithmetic.sum(self[name], value) if name in self else value


def principled(a, node):
    """`Sums` of a Principled BSDF, by an `Arithmetic`."""
    get = _inputs(a, node)
    sums, alpha = Sums(), a.saturated(get("Alpha"))
    metallic, through = (a.saturated(get(n)) for n in ("Metallic", "Transmission Weight"))
    base, tint = a.saturated_colour(get("Base Color")), get("Specular Tint")
    roughness, lie = a.saturated(get("Roughness")), _lie_of_principled(a, node, get)
    rest = a.times(alpha, a.left(metallic))
    _add_metal(a, sums, a.times(alpha, metallic), base, tint, roughness, lie)
    f0 = _f0(a, get("IOR"))
    level = a.times(f0, a.times(2.0, a.scalar("MAXIMUM", get("Specular IOR Level"), 0.0)))
    _add_dielectric(a, sums, a.times(rest, through), f0, tint, roughness)
    body = a.times(rest, a.left(through))
    _add_dielectric(a, sums, body, a.scalar("MINIMUM", level, 0.99), tint, roughness, lie)
    _note_single(sums, node)
    # Since 4.4.
    if node.inputs.get("Diffuse Roughness") is not None:
        own = a.times(a.left(a.saturated(get("Subsurface Weight"))), a.mean(base))
        _add_diffuse(a, sums, a.times(body, own), a.saturated(get("Diffuse Roughness")))
    coat = a.times(alpha, a.saturated(get("Coat Weight")))
    numbers = a.saturated(get("Coat Roughness")), _f0(a, get("Coat IOR"))
    sums.add(a, "coat", a.together(coat, *(a.times(coat, number) for number in numbers)))
    stained = a.vector("SUBTRACT", 1.0, a.saturated_colour(get("Coat Tint")))
    sums.add(a, "coat_tint", a.scaled(stained, coat))
    return sums


def glossy(a, node):
    """`Sums` of a Glossy BSDF, which before 4.0 was Anisotropic as well."""
    get, sums = _inputs(a, node), Sums()
    colour = a.vector("MAXIMUM", get("Color"), 0.0)
    roughness = a.saturated(get("Roughness"))
    sums.add(a, "glossy", colour)
    _add_rough(a, sums, a.mean(colour), roughness, _lie_of_glossy(a, node, get))
    _note_single(sums, node)
    return sums


def metallic(a, node):
    """`Sums` of a Metallic BSDF, whose colours or whose indices of refraction are given."""
    get, sums = _inputs(a, node), Sums()
    if node.fresnel_type == "F82":
        base, edge = get("Base Color"), get("Edge Tint")
    else:
        n, k = (a.vector("MAXIMUM", get(name), 0.0) for name in ("IOR", "Extinction"))
        base, at_edge = _conductor(a, n, k, 1.0), _conductor(a, n, k, _EDGE)
        schlick = a.sum(a.scaled(base, 1 - _EDGE_WHITE), np.full(3, _EDGE_WHITE))
        edge = a.vector("DIVIDE", at_edge, schlick)
    lie = _lie(a, node, a.saturated(get("Anisotropy")), get("Rotation"))
    _add_metal(a, sums, 1.0, a.saturated_colour(base), edge, a.saturated(get("Roughness")), lie)
    _note_single(sums, node)
    return sums


def glass(a, node):
    """`Sums` of what a Glass BSDF reflects; its colour tints that as well."""
    get, sums = _inputs(a, node), Sums()
    colour = a.vector("MAXIMUM", get("Color"), 0.0)
    weight = a.largest(colour)
    tint = a.vector("DIVIDE", colour, weight)
    _add_dielectric(a, sums, weight, _f0(a, get("IOR")), tint, a.saturated(get("Roughness")))
    _note_single(sums, node)
    return sums


def diffuse(a, node):
    """`Sums` of a Diffuse BSDF."""
    get, sums = _inputs(a, node), Sums()
    weight = a.mean(a.saturated_colour(get("Color")))
    _add_diffuse(a, sums, weight, a.saturated(get("Roughness")))
    return sums


def nothing(a, node):
    """`Sums` of closures that reflect no gloss."""
    return Sums()


# Types of nodes whose reflection is no such lobe, and what each is (see `LEFT_OUT`).
OTHERS = {
    "BSDF_SHEEN": "sheen", "BSDF_VELVET": "sheen", "BSDF_TOON": "toon",
    "BSDF_HAIR": "hair", "BSDF_HAIR_PRINCIPLED": "hair",
}  # fmt: skip
# What of gloss a bake cannot carry.
LEFT_OUT = {
    "sheen": "its sheen is left out",
    "toon": "its toon reflection is left out",
    "hair": "its hair shader is left out; it belongs on strands",
    "thin film": "the colours of its thin film are left out",
    "coat normal": "its coat has the normals of what lies below",
    "normals": "its shaders have different normals; all of them have the mean",
    "script": "its OSL script gives nothing, as gloss is read without OSL",
    "ior": "its IOR is below 1; it reflects as with 1 / IOR",
    "glossy rays": "its Light Path tells glossy rays from diffuse ones; reflections show it as "
    "diffuse rays meet it",
    "distribution": "its microfacets are not GGX, and are taken as if they were",
    "closure": "it has a shader that is not known here, whose reflection is left out",
    "bent": "its normal map bends reflections at the bake points only; subdivide the mesh where "
    "the map is finer",
    "roughnesses": "mixes lobes of very different roughness; they become one of their mean",
    "no tangent": "its tangent has no direction, as where a UV map is missing; a render is black "
    "there, a bake has lobes that are round",
    "anisotropy": "is more anisotropic than 1 of a Principled BSDF, which it becomes",
}
# What closures reflect, by the types of their nodes.
CLOSURES = {
    "BSDF_PRINCIPLED": principled, "BSDF_GLOSSY": glossy, "BSDF_ANISOTROPIC": glossy,
    "BSDF_METALLIC": metallic, "BSDF_GLASS": glass, "BSDF_DIFFUSE": diffuse,
    **dict.fromkeys(
        ("BSDF_REFRACTION", "BSDF_TRANSPARENT", "BSDF_TRANSLUCENT", "SUBSURFACE_SCATTERING",
         "EMISSION", "BACKGROUND", "HOLDOUT", "EEVEE_SPECULAR", "BSDF_RAY_PORTAL"), nothing),
}  # fmt: skip


def as_dielectric(a, sums, ior):
    """`Sums` of glossy lobes that are mixed in by a Fresnel factor: of a dielectric.

    Parameters
    ----------
    sums : Sums
        Of Glossy BSDFs alone.
    ior : value
        Of the Fresnel factor.
    """
    if "glossy" not in sums:  # it is black, or muted
        return Sums()
    colour = sums["glossy"]
    weight = a.largest(colour)
    f0, result = _f0(a, ior), Sums()
    result.add(a, "weights", a.together(0.0, weight, a.times(weight, f0)))
    stained = a.vector("SUBTRACT", 1.0, a.vector("DIVIDE", colour, weight))
    result.add(a, "tint", a.scaled(stained, weight))
    for name in ("rough", "tangent", "single", "others"):
        if name in sums:
            result.add(a, name, a.scaled(sums[name], _even(a, f0)))
    return result


def _inputs(a, node):
    return lambda name: a.of(node.inputs[name])


def _f0(a, ior):
    """What a dielectric reflects, seen from straight on."""
    root = a.scalar("DIVIDE", a.scalar("SUBTRACT", ior, 1.0), a.scalar("ADD", ior, 1.0))
    return a.times(root, root)


def _even(a, f0):
    """What a dielectric reflects of even light, about."""
    return a.scalar("ADD", a.times(f0, 1 - _SCHLICK), _SCHLICK)


def _conductor(a, n, k, cosine):
    """Fresnel's reflection of a metal, without the phase's small part."""
    square = a.sum(a.scaled(n, n), a.scaled(k, k))
    twice = a.scaled(n, 2 * cosine)
    parallel = a.sum(a.scaled(square, cosine**2), np.ones(3))
    across = a.sum(square, np.full(3, cosine**2))
    ratios = [
        a.vector("DIVIDE", a.vector("SUBTRACT", each, twice), a.vector("ADD", each, twice))
        for each in (parallel, across)
    ]
    return a.scaled(a.sum(*ratios), 0.5)


def _add_metal(a, sums, weight, base, edge, roughness, lie):
    metal = a.scaled(base, weight)
    sums.add(a, "metal", metal)
    sums.add(a, "weights", a.together(weight, 0.0, 0.0))
    stained = a.vector("SUBTRACT", 1.0, a.saturated_colour(edge))
    sums.add(a, "edge", a.scaled(stained, weight))
    _add_rough(a, sums, a.mean(metal), roughness, lie)


def _add_dielectric(a, sums, weight, f0, tint, roughness, lie=None):
    sums.add(a, "weights", a.together(0.0, weight, a.times(weight, f0)))
    stained = a.vector("SUBTRACT", 1.0, a.vector("MAXIMUM", tint, 0.0))
    sums.add(a, "tint", a.scaled(stained, weight))
    # Without a lobe its roughness counts for nothing.
    share = a.scalar("MINIMUM", a.times(f0, 1e4), 1.0)
    _add_rough(a, sums, a.times(weight, a.times(share, _even(a, f0))), roughness, lie)


def _add_rough(a, sums, reflected, roughness, lie):
    first = a.times(reflected, roughness)
    sums.add(a, "rough", a.together(reflected, first, a.times(first, roughness)))
    if lie is not None:
        anisotropy, tangent = lie
        amount = a.times(reflected, anisotropy)
        sums.add(a, "others", a.together(amount, 0.0, 0.0))
        sums.add(a, "tangent", a.scaled(tangent, amount))


def _note_single(sums, node):
    """Say that all lobes so far are without light of further bounces, where the node says so."""
    if node.distribution != "MULTI_GGX" and "rough" in sums:
        sums["single"] = sums["rough"]


def _add_diffuse(a, sums, weight, roughness):
    sums.add(a, "others", a.together(0.0, weight, a.times(weight, roughness)))


def _lie_of_principled(a, node, get):
    return _lie(a, node, a.saturated(get("Anisotropic")), get("Anisotropic Rotation"))


def _lie(a, node, anisotropy, turns):
    """(anisotropy, tangent) of a lobe that is longer along its tangent; None where it is round."""
    if not is_socket(anisotropy) and anisotropy <= 0:
        return None
    return anisotropy, _tangent(a, node, turns)


def _tangent(a, node, turns):
    return a.turned(_direction(a, node, "Tangent"), _direction(a, node, "Normal"), turns)


def _direction(a, node, name):
    """A direction that goes into a closure; where nothing is linked, what Cycles takes then."""
    given = a.of(node.inputs[name])
    return given if is_socket(given) else a.geometry(name)


def _lie_of_glossy(a, node, get):
    """The same of a Glossy BSDF, whose anisotropy is another: (1 - |x|)^2 = 1 - 0.9 anisotropy.

    Where it is positive the lobe is longer across its tangent.
    """
    asked = get("Anisotropy")
    if not is_socket(asked) and abs(asked) <= 1e-4:
        return None
    size = a.scalar("MAXIMUM", asked, a.times(asked, -1.0))
    rest = a.scalar("MAXIMUM", a.left(size), 0.0)
    anisotropy = a.saturated(a.scalar("DIVIDE", a.left(a.times(rest, rest)), 0.9))
    tangent = _tangent(a, node, get("Rotation"))
    across = a.vector("CROSS_PRODUCT", _direction(a, node, "Normal"), tangent)
    positive = a.scalar("GREATER_THAN", asked, 0.0)
    return anisotropy, a.mixed(positive, tangent, across)
