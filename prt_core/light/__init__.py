"""What shines: environment maps, images, sun and local lamps."""

import warnings

from prt_core import sphere
from prt_core.light.bright import BrightPixels, split_sun
from prt_core.light.environment import EnvironmentMap
from prt_core.light.images import read_image, read_picture, write_image
from prt_core.light.local import Lamp
from prt_core.light.sun import sun_light
from prt_core.light.turning import TurningLight

__all__ = [
    "BrightPixels",
    "EnvironmentMap",
    "Lamp",
    "TurningLight",
    "read_image",
    "read_picture",
    "split_sun",
    "sun_light",
    "write_image",
]

_MOVED = "CubeMap", "rotation_about_z", "rotation_matrix"


def __getattr__(name):
    """What has moved to `prt_core.sphere`, under its old name for one release."""
    if name in _MOVED:
        warnings.warn(
            f"prt_core.light.{name} is prt_core.sphere.{name} now", DeprecationWarning, stacklevel=2
        )
        return getattr(sphere, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
