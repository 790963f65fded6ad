"""What shines: directions, environment maps, images, sun and local lamps."""

from prt_core.light.bright import BrightPixels, split_sun
from prt_core.light.cubemap import CubeMap
from prt_core.light.environment import EnvironmentMap
from prt_core.light.images import read_image, read_picture, write_image
from prt_core.light.local import Lamp
from prt_core.light.rotation import rotation_about_z, rotation_matrix
from prt_core.light.sun import sun_light
from prt_core.light.turning import TurningLight

__all__ = [
    "BrightPixels",
    "CubeMap",
    "EnvironmentMap",
    "Lamp",
    "TurningLight",
    "read_image",
    "read_picture",
    "rotation_about_z",
    "rotation_matrix",
    "split_sun",
    "sun_light",
    "write_image",
]
