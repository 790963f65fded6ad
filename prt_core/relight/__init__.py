"""One bake under changing light."""

from prt_core.relight.blend import LightBlend, WeightedLight
from prt_core.relight.lighting import Lighting
from prt_core.relight.relighter import Relighter

__all__ = ["LightBlend", "Lighting", "Relighter", "WeightedLight"]
