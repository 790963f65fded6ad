"""Who answers rays: the `RayCaster` protocol, the brute-force oracle, Embree.

Blender's own BVH is in `prt_core.blender.casters`, which alone may import bpy.
"""

from prt_core.rays import brute
from prt_core.rays.boxes import boxes_around
from prt_core.rays.caster import Hits, RayCaster, as_rays, make_caster, register_caster
from prt_core.rays.frames import FramedCaster, Frames, precision_frames
from prt_core.rays.passing import MOST_LAYERS, PassingCaster, transmitted
from prt_core.rays.relay import RelayCaster, cast_on_all_cores
from prt_core.rays.shared import shared
from prt_core.rays.subset import EmptyCaster, SubsetCaster

try:
    import embreex.rtcore_scene  # noqa: F401
except ImportError:
    # Not installed, or made for a newer system (macOS before 13): `make_caster` says so if asked.
    pass
else:
    from prt_core.rays import embree

    EmbreeCaster = embree.EmbreeCaster

BruteForceCaster = brute.BruteForceCaster

__all__ = [
    "BruteForceCaster",
    "EmptyCaster",
    "FramedCaster",
    "Frames",
    "Hits",
    "MOST_LAYERS",
    "PassingCaster",
    "RayCaster",
    "RelayCaster",
    "SubsetCaster",
    "as_rays",
    "boxes_around",
    "cast_on_all_cores",
    "make_caster",
    "precision_frames",
    "register_caster",
    "shared",
    "transmitted",
]
