"""What surfaces do with light: BRDFs, and the quantities that materials have at each point."""

from prt_core.reflectance.ashikhmin_shirley import AshikhminShirley, AshikhminShirleyDiffuse
from prt_core.reflectance.brdf import Reflectance, Sum, directional_albedo, local_frames
from prt_core.reflectance.factors import LEAST_ROUGHNESS, InOutFactors, in_out_factors
from prt_core.reflectance.fresnel import Constant, Dielectric, F82Tint, RealSchlick
from prt_core.reflectance.lambert import Lambert
from prt_core.reflectance.materials import (
    QUANTITIES,
    Materials,
    Quantity,
    expect_materials,
)
from prt_core.reflectance.microfacet import SMALLEST_ALPHA, Microfacet, alphas, glossy_anisotropy
from prt_core.reflectance.oren_nayar import OrenNayar
from prt_core.reflectance.phong import Phong
from prt_core.reflectance.principled import GLOSSY_LOBES, Lobe, PrincipledLobes, principled_lobes

__all__ = [
    "AshikhminShirley",
    "AshikhminShirleyDiffuse",
    "Constant",
    "Dielectric",
    "F82Tint",
    "GLOSSY_LOBES",
    "InOutFactors",
    "LEAST_ROUGHNESS",
    "Lambert",
    "Lobe",
    "Materials",
    "Microfacet",
    "OrenNayar",
    "Phong",
    "PrincipledLobes",
    "QUANTITIES",
    "Quantity",
    "RealSchlick",
    "Reflectance",
    "SMALLEST_ALPHA",
    "Sum",
    "alphas",
    "directional_albedo",
    "expect_materials",
    "glossy_anisotropy",
    "in_out_factors",
    "local_frames",
    "principled_lobes",
]
