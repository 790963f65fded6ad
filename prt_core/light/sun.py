"""A sun: a disc of light on the cube map, none of its energy lost."""

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind, expect_number
from prt_core.light.environment import BRIGHTEST
from prt_core.sphere import CubeMap

_SAMPLES = 1 << 16
# Half a turn, as float32 knows it: Blender's is a little more.
_WIDEST = float(np.nextafter(np.float32(np.pi), np.float32(4)))


def sun_light(cube_map, direction, irradiance, angle=0.0):
    """Radiance of a sun on the texels of a cube map.

    Parameters
    ----------
    cube_map : CubeMap
    direction : (3,) float
        Towards the sun; any length but zero.
    irradiance : (3,) or float
        Power per area on a surface that faces the sun (W / m^2): Blender's sun strength times
        its colour.
    angle : float
        Diameter of the disc in radians, 0 to pi.

    Returns
    -------
    (n_directions, 3) float32
        The disc's power is spread over the texels it covers. An angle smaller than a texel
        still fills whole texels: shadows are as soft as the resolution allows.
    """
    expect_kind("cube_map", cube_map, CubeMap)
    direction = expect_array("direction", direction, (3,), np.float64)
    length = np.linalg.norm(direction)
    expect(length > 0, "direction: expected a vector of length above zero")
    angle = expect_number("angle", angle, 0, _WIDEST)
    if not isinstance(irradiance, list | tuple | np.ndarray):
        irradiance = [expect_number("irradiance", irradiance, 0)] * 3
    irradiance = expect_array("irradiance", irradiance, (3,), np.float64, 0, BRIGHTEST)
    axis = direction / length
    # Points spread evenly over the cap (a golden-angle spiral).
    i = np.arange(_SAMPLES) + 0.5
    cosine = 1 - i / _SAMPLES * (1 - np.cos(angle / 2))
    radius = np.sqrt(np.maximum(0, 1 - cosine**2))
    turn = i * np.pi * (3 - np.sqrt(5))
    u = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.6 else [0, 1.0, 0])
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    samples = cosine[:, None] * axis + radius[:, None] * (
        np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
    )
    # Equal radiance over the disc, such that a surface facing the sun gets the irradiance.
    texel = cube_map.texel_of(samples)
    share = np.bincount(texel, minlength=cube_map.n_directions) / cosine.sum()
    return (share[:, None] / cube_map.solid_angles[:, None] * irradiance).astype(np.float32)
