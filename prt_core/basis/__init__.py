"""Functions on faces, images, spheres and points, in which light and transport are sparse."""

from prt_core.basis.haar import (
    haar_areas,
    haar_forward,
    haar_inverse,
    haar_levels,
    haar_rows,
    haar_texels,
)
from prt_core.basis.point_haar import PointHaar
from prt_core.basis.point_multiwavelet import PointMultiwavelet
from prt_core.basis.spherical_harmonics import (
    harmonic_products,
    harmonics,
    rotation_of_harmonics,
    rotations_of_harmonics,
    texel_harmonics,
)
from prt_core.basis.triple_product import (
    multiplication_matrix,
    triple_product,
    tripling_coefficients,
)
from prt_core.basis.wavelets import ORTHONORMAL, WAVELETS, ImageWavelet, wavelet_rows

__all__ = [
    "ORTHONORMAL",
    "WAVELETS",
    "ImageWavelet",
    "PointHaar",
    "PointMultiwavelet",
    "haar_areas",
    "haar_forward",
    "haar_inverse",
    "haar_levels",
    "haar_rows",
    "haar_texels",
    "harmonic_products",
    "harmonics",
    "multiplication_matrix",
    "rotation_of_harmonics",
    "rotations_of_harmonics",
    "texel_harmonics",
    "triple_product",
    "tripling_coefficients",
    "wavelet_rows",
]
