"""Who answers rays: the `RayCaster` protocol, the brute-force oracle, Embree.

Blender's own BVH is in `prt_core.blender.casters`, which alone may import bpy.
"""

from importlib.util import find_spec

from prt_core.rays import brute
from prt_core.rays.caster import Hits, RayCaster, as_rays, make_caster, register_caster

if find_spec("embreex"):
    from prt_core.rays import embree

    EmbreeCaster = embree.EmbreeCaster

BruteForceCaster = brute.BruteForceCaster

__all__ = ["BruteForceCaster", "Hits", "RayCaster", "as_rays", "make_caster", "register_caster"]
