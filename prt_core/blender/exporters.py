"""Kept colours where Blender's own exporters look for them, and what these will not carry.

They take the colour attribute that is active for renders. USD carries it as it is, as a primvar.
glTF's exporter carries colours as they are only where the base colour of a Principled node reads
them; else it writes white, unless it is asked for the active ones, which it cuts to 0 to 1.
"""

import bpy
import numpy as np

from prt_core.blender.colours import KEPT_COLOURS, activate
from prt_core.blender.node_trees import all_nodes
from prt_core.blender.stand_ins import is_copy

# Objects that are named in a note.
_NAMED = 3
_READS = {"VERTEX_COLOR": "layer_name", "ATTRIBUTE": "attribute_name"}
_REMEDY = "use Export Relit glTF instead"


def offer(target, attribute):
    """Make a kept attribute the one for renders on all meshes of a scene that have it.

    Parameters
    ----------
    target : bpy.types.Scene
    attribute : str

    Returns
    -------
    list of str
        What the exporters will not carry, and what to do.
    """
    fixed, white, cut = [], [], []
    for item in target.objects:
        mesh = item.data if item.type == "MESH" and not is_copy(item) else None
        if mesh is None or mesh.library is not None or attribute not in mesh.color_attributes:
            continue
        if _reads(item, ""):
            # A material shows whatever colours are active for renders: they must stay.
            fixed.append(item.name)
            continue
        mesh[KEPT_COLOURS] = attribute
        activate(mesh, mesh.color_attributes.active_color_name)
        slots = [slot.material for slot in item.material_slots]
        if any(slots) and not (_feeds_base(item, attribute) and _all_slots_leave(slots)):
            white.append(item.name)
        elif not _feeds_base(item, attribute) and _brightest(mesh, attribute) > 1:
            cut.append(item.name)
    notes = []
    if fixed:
        notes.append(
            f"{_some(fixed)}: a material shows the colours that are active for renders, so these "
            f"stay, and exporters do not find '{attribute}'; name them in its Color Attribute node"
        )
    if white:
        notes.append(
            f"{_some(white)}: Blender's glTF exporter will write white, for no base colour reads "
            f"'{attribute}' on every slot; {_REMEDY}"
        )
    if cut:
        notes.append(f"{_some(cut)}: Blender's glTF exporter will cut colours above 1; {_REMEDY}")
    return notes


def _all_slots_leave(slots):
    """Whether the exporter of this Blender carries colours of all slots, not of the first alone."""
    return len(slots) < 2 or bpy.app.version[:2] != (5, 2)


def _reads(item, name):
    """Whether a node of the object's materials reads a colour attribute by this name."""
    return any(
        node.type == "VERTEX_COLOR" and node.layer_name == name
        for tree in _trees(item)
        for node in all_nodes(tree)
    )


def _feeds_base(item, name):
    """Whether in each of its materials the base colour of a Principled node reads the attribute."""
    trees = _trees(item)
    return bool(trees) and all(_base_reads(tree, name) for tree in trees)


def _base_reads(tree, name):
    for node in tree.nodes:
        if node.type == "BSDF_PRINCIPLED":
            waiting, seen = [node.inputs["Base Color"]], set()
            while waiting:
                for link in waiting.pop().links:
                    above = link.from_node
                    if getattr(above, _READS.get(above.type, ""), None) == name:
                        return True
                    if above.name not in seen:
                        seen.add(above.name)
                        waiting += above.inputs
    return False


def _trees(item):
    materials = (slot.material for slot in item.material_slots)
    return [m.node_tree for m in materials if m is not None and m.node_tree is not None]


def _brightest(mesh, attribute):
    data = mesh.color_attributes[attribute].data
    values = np.empty(len(data) * 4, np.float32)
    data.foreach_get("color", values)
    return values.reshape(-1, 4)[:, :3].max(initial=0)


def _some(names):
    return ", ".join(names[:_NAMED]) + (" …" if len(names) > _NAMED else "")
