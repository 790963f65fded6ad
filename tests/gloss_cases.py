"""Surfaces of one lobe each under smooth skies: what Cycles makes of them, and what we do.

Small triangles stand on a sphere and look outwards, so that nothing is seen but the sky. Skies are
sums of bright spots, known in every direction without an image between.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from prt_core.reflectance import AshikhminShirley, glossy_anisotropy, local_frames, principled_lobes
from prt_core.sphere import CubeMap, sobol_points

GOLDEN = Path(__file__).parent / "core" / "reflectance" / "golden" / "gloss.json"
N_PLACES = 36
CAMERA = np.array([2.0, -5.0, 2.5])
TANGENT = (0.9, 0.3, -0.2)
# The least cosine between view and normal: below 0.2 Cycles' bakes bend the view.
_LEAST = 0.21
# Sharpness, direction and colour of the spots of each sky, and its even light.
SKIES = {
    "spots": (
        0.05,
        [
            (60, (0.3, -0.8, 0.5), (9.0, 7.0, 3.0)),
            (15, (-0.7, -0.3, 0.6), (0.5, 2.0, 4.0)),
            (30, (0.9, 0.1, 0.3), (5.0, 1.0, 1.0)),
            (8, (0.0, 0.4, -0.9), (0.6, 1.2, 0.3)),
        ],
    ),
    "sides": (
        0.2,
        [
            (4, (0.9, 0.4, 0.1), (1.5, 1.0, 0.8)),
            (25, (-0.6, 0.7, 0.3), (2.0, 4.0, 6.0)),
            (40, (0.1, -0.5, -0.8), (6.0, 4.0, 6.0)),
        ],
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A surface as Blender's node has it, and as quantities of materials.

    Parameters
    ----------
    inputs : dict of str -> value
        Of the node.
    quantities : dict of str -> value
        Without albedo, which Cycles says.
    bound : float
        Of the relative L2 difference to Cycles.
    passes : str
        GLOSSY, DIFFUSE or COMBINED.
    node : str
    sky : str
    settings : dict of str -> value
        Of the node.
    reflectance : Reflectance, optional
        What it is, where it is no lobe of the Principled BSDF.
    least : float
        Cosine between view and normal of the places that are compared.
    narrow : bool
        Whether it falls between texels, and is summed over samples of the lobe instead.
    """

    inputs: dict
    quantities: dict
    bound: float = 0.003
    passes: str = "GLOSSY"
    node: str = "ShaderNodeBsdfPrincipled"
    sky: str = "spots"
    settings: dict = field(default_factory=dict)
    reflectance: object = None
    least: float = 0.0
    narrow: bool = False


BLACK = {"Base Color": (0, 0, 0), "Specular IOR Level": 0.0}
GOLD, GREY, BLUE = (0.9, 0.6, 0.2), (0.7, 0.6, 0.5), (0.2, 0.4, 0.8)


def _metal(roughness, more=None, quantities=None, **others):
    inputs = {"Base Color": GOLD, "Metallic": 1.0, "Roughness": roughness, **(more or {})}
    known = {"metal": GOLD, "roughness": roughness, **(quantities or {})}
    return Case(inputs, known, **others)


def _glossy(roughness, **others):
    inputs = {"Color": GREY, "Roughness": roughness}
    known = {"glossy": GREY, "roughness": roughness}
    return Case(inputs, known, node="ShaderNodeBsdfAnisotropic", **others)


def _level(level, ior):
    """The index of refraction of a specular level, as the node takes it."""
    root = np.sqrt(2 * level * ((ior - 1) / (ior + 1)) ** 2)
    return (1 + root) / (1 - root)


def _turned_tangent(normals):
    """The tangent turned by a right angle, as the Glossy BSDF has it where it is anisotropic."""
    return np.cross(normals, TANGENT)


_SPECULAR = {"Base Color": (0, 0, 0), "IOR": 1.5}
_GGX, _SINGLE = {"distribution": "GGX"}, {"single": 1}
_COAT = {"Coat Weight": 1.0, "Coat Roughness": 0.3}
_TINTED = {"Coat Weight": 0.7, "Coat Roughness": 0.3, "Coat IOR": 1.6, "Coat Tint": BLUE}
_TINTED_KNOWN = {"coat": 0.7, "coat_roughness": 0.3, "coat_ior": 1.6, "coat_tint": BLUE}
CASES = {
    "glossy 0.2": _glossy(0.2),
    "glossy 0.5": _glossy(0.5),
    "glossy 1.0": _glossy(1.0, sky="sides"),
    "glossy 0.5 anisotropic 0.5": Case(
        {"Color": GREY, "Roughness": 0.5, "Anisotropy": 0.5},
        {"glossy": GREY, "roughness": 0.5, "anisotropy": float(glossy_anisotropy(0.5)[0]),
         "tangent": _turned_tangent}, node="ShaderNodeBsdfAnisotropic",
    ),
    # Half vectors that a viewer sees from behind send Cycles' sampler astray: these matter where a
    # wide lobe is seen from aside, and there its mean is not what it evaluates.
    "ashikhmin-shirley": Case(
        {"Color": (1, 1, 1), "Roughness": 0.5, "Anisotropy": 0.5}, {"tangent": TANGENT}, 0.01,
        node="ShaderNodeBsdfAnisotropic", settings={"distribution": "ASHIKHMIN_SHIRLEY"},
        reflectance=AshikhminShirley(2 / 0.125**2 - 2, 2 / 0.5**2 - 2), least=0.45,
    ),
    "metal 0.2": _metal(0.2),
    "metal 0.5": _metal(0.5),
    "metal 0.8 edge": _metal(
        0.8, {"Specular Tint": (0.3, 0.6, 1)}, {"metal_edge": (0.3, 0.6, 1)}, sky="sides"
    ),
    "metal 0.4 anisotropic 0.8": _metal(
        0.4, {"Anisotropic": 0.8}, {"anisotropy": 0.8, "tangent": TANGENT}
    ),
    "metal 0.05": _metal(0.05, narrow=True),
    "metal 0.15 anisotropic 1.0": _metal(
        0.15, {"Anisotropic": 1.0}, {"anisotropy": 1.0, "tangent": TANGENT}, narrow=True
    ),
    "coat 0.03 over metal": _metal(
        0.5, {**_TINTED, "Coat Roughness": 0.03}, {**_TINTED_KNOWN, "coat_roughness": 0.03},
        narrow=True,
    ),
    "half metal 0.5": _metal(
        0.5, {"Metallic": 0.5},
        {"metal": tuple(c / 2 for c in GOLD), "dielectric": 0.5}, sky="sides"
    ),
    "metal 0.8 of one bounce": _metal(0.8, quantities=_SINGLE, settings=_GGX, sky="sides"),
    "all of one bounce": Case(
        {"Base Color": GREY, "Metallic": 0.3, "Roughness": 0.9, "Specular IOR Level": 1.0,
         "IOR": 1.8},
        {"metal": tuple(0.3 * c for c in GREY), "dielectric": 0.7, "roughness": 0.9,
         "ior": _level(1.0, 1.8), **_SINGLE},
        passes="COMBINED", settings=_GGX,
    ),
    "dielectric 0.3": Case(
        {**_SPECULAR, "Roughness": 0.3}, {"dielectric": 1, "roughness": 0.3}
    ),
    "dielectric 0.7 tint": Case(
        {**_SPECULAR, "Roughness": 0.7, "Specular Tint": BLUE, "Specular IOR Level": 0.8},
        {"dielectric": 1, "roughness": 0.7, "tint": BLUE, "ior": _level(0.8, 1.5)},
        sky="sides",
    ),
    "coat 0.3": Case({**BLACK, **_COAT}, {"coat": 1, "coat_roughness": 0.3}),
    "coat over metal": _metal(0.5, _TINTED, _TINTED_KNOWN, sky="sides"),
    "diffuse below specular": Case(
        {"Base Color": GREY, "Roughness": 0.4}, {"dielectric": 1, "roughness": 0.4},
        passes="DIFFUSE",
    ),
    "diffuse below coat": Case(
        {"Base Color": GREY, "Specular IOR Level": 0.0, **_TINTED}, _TINTED_KNOWN,
        passes="DIFFUSE", sky="sides",
    ),
    "rough diffuse": Case(
        {"Base Color": GREY, "Specular IOR Level": 0.0, "Diffuse Roughness": 1.0},
        {"diffuse_roughness": 1.0}, passes="DIFFUSE",
    ),
    "all": Case(
        {"Base Color": GREY, "Metallic": 0.3, "Roughness": 0.5, "Diffuse Roughness": 0.5,
         **_TINTED},
        {"metal": tuple(0.3 * c for c in GREY), "dielectric": 0.7, "roughness": 0.5,
         "diffuse_roughness": 0.5, **_TINTED_KNOWN},
        passes="COMBINED",
    ),
}  # fmt: skip


def places():
    """Normals and views of all places: (N_PLACES, 3) unit vectors each.

    Normals are even over what the camera sees; places are their tips.
    """
    z = 1 - (2 * np.arange(4 * N_PLACES) + 1) / (4 * N_PLACES)
    angle = np.arange(4 * N_PLACES) * np.pi * (3 - 5**0.5)
    flat = np.sqrt(1 - z**2)
    normals = np.column_stack([flat * np.cos(angle), flat * np.sin(angle), z])
    views = CAMERA - normals
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    seen = np.flatnonzero((normals * views).sum(axis=1) > _LEAST)
    chosen = seen[np.linspace(0, len(seen) - 1, N_PLACES).astype(int)]
    return normals[chosen], views[chosen]


def sky_radiance(name, directions):
    """(n, 3) radiance of a sky along directions (n, 3)."""
    even, spots = SKIES[name]
    result = np.full(directions.shape, even)
    for sharpness, towards, colour in spots:
        towards = np.array(towards) / np.linalg.norm(towards)
        result = result + np.exp(sharpness * (directions @ towards - 1))[:, None] * colour
    return result


def materials_of(case, albedo):
    """Something that has the quantities of a case at every place, as `Materials` would."""
    values = {
        "albedo": albedo, "stand_in": 0, "glossy": 0, "metal": 0, "metal_edge": 1, "dielectric": 0,
        "tint": 1, "ior": 1.5, "roughness": 1, "anisotropy": 0, "tangent": 0, "single": 0,
        "coat": 0, "coat_roughness": 0.03, "coat_ior": 1.5, "coat_tint": 1, "diffuse_roughness": 0,
        "opacity": 1, **case.quantities,
    }  # fmt: skip
    if callable(values["tangent"]):
        values["tangent"] = values["tangent"](places()[0])
    one = {"dielectric", "ior", "roughness", "anisotropy", "single", "coat", "coat_roughness",
           "coat_ior", "diffuse_roughness", "opacity"}  # fmt: skip
    return SimpleNamespace(**{
        name: np.broadcast_to(np.asarray(value, float), (N_PLACES, 1 if name in one else 3))
        for name, value in values.items()
    })  # fmt: skip


def radiance_of(case, albedo, resolution, power=12):
    """(N_PLACES, 3) radiance of a case to the camera, by `dense_sum`, or `sampled_sum` if narrow.

    Parameters
    ----------
    case : Case
    albedo : (3,) float
        As Cycles' Diffuse Color pass has it from straight above.
    resolution : int
        Of the cube map.
    power : int
        2 to this many samples.
    """
    if case.narrow:
        return sampled_sum(case, albedo, power)
    return dense_sum(case, albedo, resolution)


def lobes_at_places(case, albedo):
    """(lobes, their frames (N_PLACES, 3, 3), views in these (N_PLACES, 1, 3)) of a case."""
    normals, views = places()
    materials = materials_of(case, albedo)
    lobes = case.reflectance or principled_lobes(materials)
    frames = local_frames(normals, materials.tangent).astype(np.float32)
    return lobes, frames, np.einsum("nij,nj->ni", frames, views.astype(np.float32))[:, None]


def dense_sum(case, albedo, resolution, at_once=4096):
    """(N_PLACES, 3): the BRDF times the sky, summed over all texels, so many `at_once`.

    Parameters
    ----------
    case, albedo, resolution
        See `radiance_of`.
    at_once : int
    """
    cube_map = CubeMap(resolution)
    radiance = sky_radiance(case.sky, cube_map.directions) * cube_map.solid_angles[:, None]
    lobes, frames, outgoing = lobes_at_places(case, albedo)
    result = np.zeros((N_PLACES, 3))
    for first in range(0, cube_map.n_directions, at_once):
        texels = slice(first, first + at_once)
        incoming = np.einsum("nij,mj->nmi", frames, cube_map.directions[texels].astype(np.float32))
        value = 0.0
        if case.passes != "DIFFUSE":
            value = value + lobes.eval(incoming, outgoing)
        if case.passes != "GLOSSY":
            value = value + lobes.diffuse_eval(incoming, outgoing)
        value = value * np.maximum(incoming[..., 2:], 0)
        result += np.einsum("nmc,mc->nc", value, radiance[texels])
    return result


def sampled_sum(case, albedo, power):
    """(N_PLACES, 3): the glossy lobes times the sky, over their own samples; see `radiance_of`."""
    lobes, frames, outgoing = lobes_at_places(case, albedo)
    uv = np.broadcast_to(sobol_points(power) + 0.5 / 2**power, (N_PLACES, 2**power, 2))
    incoming = lobes.sample(outgoing, uv.astype(np.float32))
    density = lobes.pdf(incoming, outgoing)
    weight = np.maximum(incoming[..., 2], 0) / np.where(density > 0, density, np.inf)
    world = incoming @ frames
    radiance = sky_radiance(case.sky, world.reshape(-1, 3)).reshape(world.shape)
    value = lobes.eval(incoming, outgoing) * radiance
    return (value.astype(np.float64) * weight[..., None]).mean(axis=1)


def difference(case, values, truth):
    """Relative L2 difference of values to a truth, both (N_PLACES, 3), of a case."""
    seen = compared(case)
    return float(np.linalg.norm((values - truth)[seen]) / np.linalg.norm(truth[seen]))


def compared(case):
    """(N_PLACES,) bool: the places of a case that are held against Cycles."""
    normals, views = places()
    return (normals * views).sum(axis=1) > case.least


def read_golden():
    """{case: {"radiance": (N_PLACES, 3), "albedo": (3,), "noise": float}} and Blender's version."""
    content = json.loads(GOLDEN.read_text())
    cases = {
        name: {key: np.asarray(value) for key, value in entry.items()}
        for name, entry in content["cases"].items()
    }
    return cases, content["blender"]
