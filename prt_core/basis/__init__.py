"""Functions on faces, images, spheres and points, in which light and transport are sparse."""

from prt_core.basis.haar import haar_areas, haar_forward, haar_inverse, haar_levels, haar_rows
from prt_core.basis.spherical_harmonics import harmonics, rotation_of_harmonics, texel_harmonics

__all__ = [
    "haar_areas",
    "haar_forward",
    "haar_inverse",
    "haar_levels",
    "haar_rows",
    "harmonics",
    "rotation_of_harmonics",
    "texel_harmonics",
]
