"""Blender's side of the core: the only folder that imports bpy.

Importing it makes Blender's ray casters known by name (`blender`, `bvhtree`) and lends the
image reader Blender's own for .exr, inside the program Blender.
"""

import bpy  # noqa: F401  (must come before mathutils)

from prt_core.blender import casters, images, render_scene
from prt_core.blender.colours import write_colours
from prt_core.blender.depsgraph import read_meshes
from prt_core.blender.lamps import read_lamps
from prt_core.blender.realised import build_objects
from prt_core.blender.world import read_world

casters.register()
images.register()
render_scene.register()

__all__ = ["build_objects", "read_lamps", "read_meshes", "read_world", "write_colours"]
