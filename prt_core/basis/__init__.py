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
from prt_core.basis.spherical_harmonics import harmonics, rotation_of_harmonics, texel_harmonics
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
    "harmonics",
    "rotation_of_harmonics",
    "texel_harmonics",
    "wavelet_rows",
]
