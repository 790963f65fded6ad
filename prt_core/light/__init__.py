"""What shines: environment maps, images, sun and local lamps."""

from prt_core import sphere
from prt_core.light.bright import BrightPixels, split_sun
from prt_core.light.environment import EnvironmentMap
from prt_core.light.images import read_image, read_picture, write_image
from prt_core.light.local import Lamp
from prt_core.light.sky import Sky
from prt_core.light.sun import sun_light
from prt_core.light.turning import TurningLight
from prt_core.runtime.renamed import renamed_names

__all__ = [
    "BrightPixels",
    "EnvironmentMap",
    "Lamp",
    "Sky",
    "TurningLight",
    "read_image",
    "read_picture",
    "split_sun",
    "sun_light",
    "write_image",
]

__getattr__ = renamed_names(
    __name__,
    {
        name: (f"prt_core.sphere.{name}", getattr(sphere, name))
        for name in ("CubeMap", "rotation_about_z", "rotation_matrix")
    },
)
