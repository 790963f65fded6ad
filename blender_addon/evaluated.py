"""What Blender has evaluated anew: light, or what is baked."""

import bpy

from .plan import GEOMETRY


def what_changed(depsgraph):
    """Whether light, and whether what is baked, is among what was evaluated anew.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph

    Returns
    -------
    bool, bool
    """
    light = geometry = False
    for update in depsgraph.updates:
        changed = update.id
        if isinstance(changed, bpy.types.World | bpy.types.Light | bpy.types.Image):
            light = True
        elif isinstance(changed, bpy.types.Object):
            if changed.type == "LIGHT":
                light = True
            elif changed.type in GEOMETRY or changed.instance_type != "NONE":
                geometry |= update.is_updated_transform or update.is_updated_geometry
        elif isinstance(changed, bpy.types.Material):
            geometry = True
        elif isinstance(changed, bpy.types.NodeTree):
            light = True
    return light, geometry
