"""What of a scene is quick to make and compare: where its objects are, and how they are grouped."""

import numpy as np

from prt_core.blender.stand_ins import is_copy, is_kept, renders

GEOMETRY = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


def shape_of(scene, depsgraph=None):
    """Where the objects of a scene are and how large their meshes: quick to make and compare.

    Parameters
    ----------
    scene : bpy.types.Scene or None
    depsgraph : bpy.types.Depsgraph, optional
        Where a frame that renders is evaluated.

    Returns
    -------
    dict of int -> (str, (4, 4) float, int)
        By `session_uid`: name, matrix and number of corners.
    """
    shapes = {}
    for item in scene.objects if scene is not None else ():
        if item.type not in GEOMETRY and item.instance_type == "NONE":
            continue
        if is_copy(item) or is_kept(item) or not renders(item):
            continue
        seen = item if depsgraph is None else item.evaluated_get(depsgraph)
        corners = len(item.data.loops) if item.type == "MESH" else 0
        shapes[item.session_uid] = item.name, np.array(seen.matrix_world), corners
    return shapes


def groups_of(scene):
    """A scene's collections, what renders of them, and what is in them: quick to compare."""
    groups = []

    def visit(layer):
        group = layer.collection
        switches = layer.exclude, layer.holdout, layer.indirect_only, group.hide_render
        groups.append((group.name, switches, tuple(o.session_uid for o in group.objects)))
        for child in layer.children:
            visit(child)

    for layer in scene.view_layers if scene is not None else ():
        groups.append((layer.name, layer.use))
        visit(layer.layer_collection)
    return tuple(groups)
