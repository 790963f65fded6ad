"""What of a scene is quick to make and compare: where its objects are, and how they are grouped."""

import numpy as np

from prt_core.blender.stand_ins import ORIGINAL, is_copy, is_kept, renders
from prt_core.errors import expect

from .deforming import deforms

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
    dict of int -> (str, (4, 4) float, int, float or None)
        By `session_uid`: name, matrix and number of corners; the frame where it deforms over time.
    """
    shapes = {}
    for item in scene.objects if scene is not None else ():
        if item.type not in GEOMETRY and item.instance_type == "NONE":
            continue
        if is_copy(item) or is_kept(item) or not renders(item):
            continue
        seen = item if depsgraph is None else item.evaluated_get(depsgraph)
        corners = len(item.data.loops) if item.type == "MESH" else 0
        frame = scene.frame_current_final if deforms(item) else None
        shapes[item.session_uid] = item.name, np.array(seen.matrix_world), corners, frame
    return shapes


def chosen_names(context, where, what):
    """Full names of the selected objects that a bake has, each once.

    A realised copy or a kept object stands for the object that it was made of, which it hides.

    Parameters
    ----------
    context : bpy.types.Context
    where, what : str
        For messages: what asks, and for which objects.

    Raises
    ------
    PRTError
        Nothing is selected, or nothing that has faces and renders.
    """
    selected = [item.get(ORIGINAL) or item for item in context.selected_objects]
    expect(selected, f"{where}: nothing is selected; select {what}")
    names = [
        item.name_full
        for item in selected
        if (item.type in GEOMETRY or item.instance_type != "NONE") and renders(item)
    ]
    few = ", ".join(item.name for item in selected[:3]) + (" …" if len(selected) > 3 else "")
    expect(names, f"{where}: nothing that is selected has faces and renders ({few}); select {what}")
    return list(dict.fromkeys(names))


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
