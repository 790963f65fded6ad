"""Wrong calls of `prt_core.reflectance`."""

import numpy as np
import pytest

from prt_core import reflectance

from .calls import faults_of, method, plain

DIRECTIONS = np.array([[0, 0.6, 0.8], [0.6, 0, 0.8]])
# Parameters are numbers or arrays of any shape that fits the directions.
SHAPES = ("list", "another axis", "no elements", "one more", "one less", "number")


def shapes(*names):
    return tuple(f"{name} {label}" for name in names for label in SHAPES)


CALLS = {
    "Lambert": plain(reflectance.Lambert, shapes("albedo"), albedo=np.full(3, 0.5)),
    "OrenNayar": plain(
        reflectance.OrenNayar, shapes("albedo", "roughness", "colour"),
        albedo=np.full(3, 0.5), roughness=0.5, colour=np.full(3, 0.5),
    ),
    "Phong": plain(
        reflectance.Phong, shapes("exponent", "reflectance"), exponent=10.0, reflectance=0.5
    ),
    "AshikhminShirley": plain(
        reflectance.AshikhminShirley, shapes("exponent_x", "exponent_y", "reflectance"),
        exponent_x=10.0, exponent_y=20.0, reflectance=0.5,
    ),
    "AshikhminShirleyDiffuse": plain(
        reflectance.AshikhminShirleyDiffuse, shapes("albedo", "reflectance"),
        albedo=0.5, reflectance=np.full(3, 0.5),
    ),
    "Microfacet": plain(
        reflectance.Microfacet, shapes("alpha_x", "alpha_y"),
        alpha_x=0.2, alpha_y=0.3, fresnel=reflectance.Constant(), multiple=True,
    ),
    "Constant": plain(reflectance.Constant, shapes("colour"), colour=0.5),
    "Dielectric": plain(reflectance.Dielectric, shapes("ior"), ior=1.5),
    "RealSchlick": plain(
        reflectance.RealSchlick, shapes("f0", "f90", "ior"), f0=np.full(3, 0.1), f90=1.0, ior=1.5
    ),
    "F82Tint": plain(
        reflectance.F82Tint, shapes("f0", "tint", "weight"), f0=np.full(3, 0.5), tint=0.5,
        weight=1.0,
    ),
    "Sum": plain(
        reflectance.Sum, lobes=[reflectance.Lambert(), reflectance.Phong(3)],
        shares=np.array([0.5, 0.5]),
    ),
    "alphas": plain(
        reflectance.alphas, shapes("roughness", "anisotropy"), roughness=0.5, anisotropy=0.5
    ),
    "glossy_anisotropy": plain(reflectance.glossy_anisotropy, shapes("slider"), slider=0.5),
    "directional_albedo": plain(
        reflectance.directional_albedo,
        ("outgoing another axis", "outgoing no elements", "outgoing one less"),
        reflectance=reflectance.Phong(3), outgoing=DIRECTIONS, power=2,
    ),
    "local_frames": plain(reflectance.local_frames, normals=DIRECTIONS, tangent=DIRECTIONS[::-1]),
    "in_out_factors": plain(
        reflectance.in_out_factors, reflectance=reflectance.Phong(3), n_terms=3, size=4, seed=1
    ),
    "principled_lobes": plain(
        reflectance.principled_lobes, materials=reflectance.Dielectric(1.5)
    ),
}  # fmt: skip
LOBES = {
    "phong": reflectance.Phong(3),
    "ggx": reflectance.Microfacet(0.2, 0.3),
    "oren-nayar": reflectance.OrenNayar(0.5, 0.5),
}
for key, lobe in LOBES.items():
    for called in ("eval", "pdf"):
        CALLS[f"{key} {called}"] = method(
            lambda there, lobe=lobe: lobe, called,
            tuple(f"{name} {label}" for name in ("incoming", "outgoing")
                  for label in ("another axis", "no elements", "one less", "negative")),
            incoming=DIRECTIONS, outgoing=DIRECTIONS[::-1],
        )  # fmt: skip
    CALLS[f"{key} sample"] = method(
        lambda there, lobe=lobe: lobe, "sample",
        ("uv another axis", "uv one less", "outgoing another axis", "outgoing one less",
         "outgoing no elements", "uv no elements"),
        outgoing=DIRECTIONS, uv=np.array([[0.1, 0.2], [0.6, 0.9]]),
    )  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_wrong_in_turn(there, name):
    call = CALLS[name](there)
    call.whole = name != "principled_lobes"
    faults = faults_of(call, there.folder)
    assert not faults, "\n".join(faults)
