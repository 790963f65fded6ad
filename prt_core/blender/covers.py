"""Modifiers that cover an object's materials by others; the materials stay on the object.

One is the preview's and goes with it. The other shows what was kept, an attribute or a lightmap, in
every shading mode and render, until the user removes it. A bake reads what lies beneath both.
"""

import bpy

from prt_core.blender.realised import PREVIEW
from prt_core.blender.stand_ins import KEPT

# The modifier of what was kept, as the user sees it.
KEPT_COVER = "PRT Kept"


def covers_of(item):
    """The modifiers of an object that cover its materials.

    Parameters
    ----------
    item : bpy.types.Object

    Returns
    -------
    list of bpy.types.Modifier
    """
    found = (item.modifiers.get(name) for name in (PREVIEW, KEPT_COVER))
    return [modifier for modifier in found if modifier is not None]


def cover(item, material):
    """Show a material on all faces of an object, below the preview where that is shown.

    Parameters
    ----------
    item : bpy.types.Object
        Of the file itself; what it was covered with before is replaced.
    material : bpy.types.Material
    """
    modifier = item.modifiers.get(KEPT_COVER)
    if modifier is None:
        modifier = item.modifiers.new(KEPT_COVER, "NODES")
        modifier.show_expanded = False
        above = item.modifiers.find(PREVIEW)
        if above >= 0:
            item.modifiers.move(len(item.modifiers) - 1, above)
    modifier.node_group = _group(material)


def _group(material):
    """Geometry nodes that put a material on everything."""
    for group in bpy.data.node_groups:
        ours = group.library is None and group.get(KEPT) and "Material" in group.nodes
        if ours and group.nodes["Material"].inputs["Material"].default_value == material:
            return group
    group = bpy.data.node_groups.new(material.name, "GeometryNodeTree")
    group[KEPT] = True
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    put = group.nodes.new("GeometryNodeSetMaterial")
    put.name, put.inputs["Material"].default_value = "Material", material
    group.links.new(group.nodes.new("NodeGroupInput").outputs[0], put.inputs["Geometry"])
    group.links.new(put.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    return group
