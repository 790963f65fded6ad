"""The ground floor of directions: cube map, rotations, frames, warps, maps of (half) the sphere."""

from prt_core.sphere.cubemap import FACES, CubeMap
from prt_core.sphere.frames import tangent_frames, tangents
from prt_core.sphere.hemisphere import (
    hemisphere_directions,
    hemisphere_solid_angle,
    hemisphere_square,
)
from prt_core.sphere.octahedron import octahedral_directions, octahedral_square
from prt_core.sphere.rotation import rotation_about_z, rotation_matrix
from prt_core.sphere.sobol import sobol_points
from prt_core.sphere.warp import (
    cone_density,
    cosine_density,
    cosine_power,
    cosine_power_density,
    disc_density,
    ggx_density,
    ggx_normal_density,
    square_to_cone,
    square_to_cosine,
    square_to_cosine_power,
    square_to_disc,
    square_to_ggx_normals,
)

__all__ = [
    "CubeMap",
    "FACES",
    "cone_density",
    "cosine_density",
    "cosine_power",
    "cosine_power_density",
    "disc_density",
    "ggx_density",
    "ggx_normal_density",
    "hemisphere_directions",
    "hemisphere_solid_angle",
    "hemisphere_square",
    "octahedral_directions",
    "octahedral_square",
    "rotation_about_z",
    "rotation_matrix",
    "sobol_points",
    "square_to_cone",
    "square_to_cosine",
    "square_to_cosine_power",
    "square_to_disc",
    "square_to_ggx_normals",
    "tangent_frames",
    "tangents",
]
