"""Precomputed radiance transfer: bake how light travels in a scene once, relight it at once.

The calls most people need:

>>> bake("scene.blend", "scene.prt")                        # with bpy: once
>>> bake = load("scene.prt")                                # then, anywhere
>>> colours = relight(bake, "city.exr", rotation=30)        # {object: (n_corners, 3) float32}
>>> compress("scene.prt", tolerance=0.01)                   # then a light takes milliseconds
>>> export_glb(bake, "scene.glb", "city.exr")               # for engines and browsers
>>> export_web("scene.prt", "page")                         # a web page that relights it
>>> occlusion("scene.prt", distance=0.5)                    # what it knows beside light
>>> light_field("scene.blend", "scene.slf", lamps=True)     # any material, from any side

Vocabulary: *bake points* receive and bounce light (one per distinct corner normal); *directions*
are the texels of a cube map, from the surface to the light, in Blender's world axes (z up); a
*light* is (n_directions, 3) radiance, linear Rec.709; *received* light is irradiance / pi; the
*radiance* of a point is what it sends out. Lengths are Blender units.

Objects: `Scene`, `BakePoints`, `RayCaster` (`make_caster`), `Transport`, `BakeStore`, `CubeMap`,
`EnvironmentMap`, `Lamp`, `Lighting` (all that shines), `Camera`, `View`, `Relighter` (one bake
under changing light), `LightBlend` (under several lights, each a `WeightedLight`). Functions on
arrays are in `prt_core.transport`, `prt_core.light` and `prt_core.sphere`.
"""

from prt_core.api import (
    bake,
    compress,
    compress_bake,
    environment_light,
    export_glb,
    export_web,
    finish,
    light_field,
    occlusion,
    open_blend,
    relight,
    relight_points,
)
from prt_core.bake import Bake, BakeSettings, bake_steps, load
from prt_core.bake.compress import CompressSettings
from prt_core.bake.light_field import LightFieldSettings, capture_light_field
from prt_core.bake.light_field_load import LightField, load_light_field
from prt_core.errors import PRTError
from prt_core.export.glb import GLBSettings
from prt_core.light import EnvironmentMap, Lamp
from prt_core.rays import Hits, RayCaster, make_caster
from prt_core.relight import LightBlend, Lighting, Relighter, WeightedLight
from prt_core.runtime.progress import Progress, run
from prt_core.scene import BakePoints, Camera, Mesh, Scene
from prt_core.sphere import CubeMap
from prt_core.store import BakeStore
from prt_core.transport import Occlusion, Transport, View
from prt_core.version import __version__

__all__ = [
    "Bake",
    "BakePoints",
    "BakeSettings",
    "BakeStore",
    "Camera",
    "CompressSettings",
    "CubeMap",
    "EnvironmentMap",
    "GLBSettings",
    "Hits",
    "Lamp",
    "LightBlend",
    "LightField",
    "LightFieldSettings",
    "Lighting",
    "Mesh",
    "Occlusion",
    "PRTError",
    "Progress",
    "RayCaster",
    "Relighter",
    "Scene",
    "Transport",
    "View",
    "WeightedLight",
    "__version__",
    "bake",
    "bake_steps",
    "capture_light_field",
    "compress",
    "compress_bake",
    "environment_light",
    "export_glb",
    "export_web",
    "finish",
    "light_field",
    "load",
    "load_light_field",
    "make_caster",
    "occlusion",
    "open_blend",
    "relight",
    "relight_points",
    "run",
]
