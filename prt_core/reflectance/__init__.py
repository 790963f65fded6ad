"""What surfaces do with light: BRDFs, and the quantities that materials have at each point."""

from prt_core.reflectance.ashikhmin_shirley import AshikhminShirley, AshikhminShirleyDiffuse
from prt_core.reflectance.brdf import Reflectance, Sum, directional_albedo, local_frames
from prt_core.reflectance.fresnel import Constant, Dielectric, F82Tint, RealSchlick
from prt_core.reflectance.lambert import Lambert
from prt_core.reflectance.materials import (
    QUANTITIES,
    Materials,
    Quantity,
    expect_materials,
)
from prt_core.reflectance.microfacet import SMALLEST_ALPHA, Microfacet, alphas
from prt_core.reflectance.oren_nayar import OrenNayar
from prt_core.reflectance.phong import Phong

__all__ = [
    "AshikhminShirley",
    "AshikhminShirleyDiffuse",
    "Constant",
    "Dielectric",
    "F82Tint",
    "Lambert",
    "Materials",
    "Microfacet",
    "OrenNayar",
    "Phong",
    "QUANTITIES",
    "Quantity",
    "RealSchlick",
    "Reflectance",
    "SMALLEST_ALPHA",
    "Sum",
    "alphas",
    "directional_albedo",
    "expect_materials",
    "local_frames",
]
