"""What a person should know before a scene is baked, and what helps."""

import bpy

from prt_core.blender.passes.quantities import LINES
from prt_core.blender.stand_ins import is_kept, renders

from . import plan

# What is said of materials whose gloss is not baked.
_LACKS_GLOSS = LINES["metal"], LINES["specular"]


def warnings(scene):
    """What a person should know before a scene is baked, the gravest first.

    Parameters
    ----------
    scene : bpy.types.Scene

    Returns
    -------
    list of (str, str or None, str or None)
        Text, operator that helps, its object.
    """
    planned, _ = plan.of(scene)
    said = [] if planned is None else [(text, _remedy(text), None) for text in planned.messages]
    if planned is not None and planned.cost is None:
        return said + _unsaved(scene) + _hidden(scene)
    # Where meshes are refined, vertices come to where shadows end.
    coarse = [] if planned is None or scene.prt.refine else _coarse(scene, planned.cost)
    return coarse + _unsaved(scene) + said + _hidden(scene)


def _remedy(text):
    """The operator that helps against what was said of materials, or None."""
    return "prt.use_gloss" if any(line in text for line in _LACKS_GLOSS) else None


def _coarse(scene, cost):
    own = {item.name: item.type for item in scene.objects if item.library is None}
    lines = []
    for name, (distance, _) in cost.coarse.items():
        helps = "prt.subdivide" if own.get(name) == "MESH" else None
        lines.append((f"{name}: a vertex every {distance:.2g}, too few for shadows", helps, name))
    return lines


def _unsaved(scene):
    if bpy.data.filepath or not (scene.prt.folder or "//").startswith("//"):
        return []
    text = "File not saved: bakes are kept in a temporary folder"
    return [(text, "wm.save_mainfile", None)]


def _hidden(scene):
    lines = []
    for item in scene.objects:
        hidden = item.type in plan.GEOMETRY and item.prt.receives and not renders(item)
        if hidden and not is_kept(item):
            helps = "prt.unhide" if item.library is None else None
            lines.append((f"{item.name}: hidden in renders, not baked", helps, item.name))
    return lines
