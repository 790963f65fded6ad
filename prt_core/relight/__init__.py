"""One bake under changing light."""

from prt_core.relight.lighting import Lighting
from prt_core.relight.relighter import Relighter

__all__ = ["Lighting", "Relighter"]
