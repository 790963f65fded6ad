"""The preview's look: a bake's colours in every shading mode, and everything as it was before.

It changes nothing that `restore` cannot take back: materials stay on their objects and are covered
by a Set Material modifier; what realised copies stand in for is hidden and marked.

Beside the attribute of the colours there are two more: what Solid mode shows, which knows no view
transform, and the light that the user's own materials are shown in.
"""

import bpy

from prt_core.blender.colours import (
    ACTIVE_BEFORE,
    PREVIEW_COLOURS,
    activate,
    light_name,
    names_of_preview,
    places_of,
)
from prt_core.blender.identity import objects_by_place
from prt_core.blender.own_materials import forget_copies, relit_material
from prt_core.blender.realised import PREVIEW, holds, preview_material, remove_copies
from prt_core.blender.stand_ins import COPY, arrange, is_copy
from prt_core.blender.worn_materials import wear_colours, wear_own

LOOKS = ("COLOURS", "MATERIALS", "SOLID")


def show_colours(
    scene, attribute="PRT", look="COLOURS", places=None, names=None, target=None
):  # fmt: skip
    """Show the colours of a bake in every shading mode: cover the materials of its objects.

    Parameters
    ----------
    scene : Scene
        Whose colours `write_all` has written.
    attribute : str
    look : {"COLOURS", "MATERIALS", "SOLID"}
        In Material Preview and renders: the colours as emission, the light of `light_name` on
        the objects' own materials, or nothing: then only Solid mode shows them. Realised copies
        have the materials of what they were made of, or the colours.
    places : dict of str -> (str, str), optional
        As `write_all` takes it.
    names : collection of str, optional
        Of the baked objects that are meant; default: all that receive.
    target : bpy.types.Scene, optional
        Where the copies are; default: the current one.
    """
    group = _shading_group(attribute, [preview_material(attribute)]) if look == "COLOURS" else None
    places, objects = places_of(scene, places), objects_by_place()
    for item in scene.objects:
        meant = item.receives if names is None else item.name in names
        present = objects.get(places[item.name]) if item.own_mesh and meant else None
        if present is not None:
            _shade(present, _own_group(present, attribute) if look == "MATERIALS" else group)
    _dress_copies(scene, attribute, look, places, objects, target or bpy.context.scene)


def _dress_copies(scene, attribute, look, places, objects, target):
    """The materials of the realised copies that hold the attribute."""
    copies = {o[COPY]: o for o in target.objects if is_copy(o) and holds(o, [attribute])}
    for item in scene.objects if copies else ():
        copy = copies.get(item.name)
        if copy is not None and look == "MATERIALS":
            normals = scene.points.normals[item.corner_point]
            owner = objects.get(places[item.name])
            wear_own(copy, item, owner, normals, light_name(attribute))
        elif copy is not None:
            wear_colours(copy, preview_material(attribute))


def materials_changed(attribute):
    """The user's materials are not as they were: their copies are made again when next shown."""
    forget_copies(light_name(attribute))


def held_by(scene, attribute, target, places=None):
    """Names of the baked objects that show a colour attribute, themselves or by a copy.

    Parameters
    ----------
    scene : Scene
    attribute : str
    target : bpy.types.Scene
    places : dict of str -> (str, str), optional
        As `write_all` takes it.

    Returns
    -------
    set of str
    """
    places, objects = places_of(scene, places), objects_by_place()
    names = {o[COPY] for o in target.objects if is_copy(o) and holds(o, [attribute])}
    for item in scene.objects:
        present = objects.get(places[item.name]) if item.own_mesh else None
        if present is not None and holds(present, [attribute]):
            names.add(item.name)
    return names


def restore(target=None, attributes=(), of=None):
    """Take the preview back: materials, visibility, active colours; copies are removed.

    Parameters
    ----------
    target : bpy.types.Scene, optional
    attributes : sequence of str
        Colour attributes to remove as well.
    of : callable(bpy.types.Object) -> bool, optional
        Which objects and copies are meant; default: all.

    Returns
    -------
    int
        How many objects of the user's are as they were.
    """
    target = target or bpy.context.scene
    changed = 0
    meant = [o for o in target.objects if o.library is None and (of is None or of(o))]
    for item in meant:
        shaded = item.modifiers.get(PREVIEW) if item.type == "MESH" else None
        if shaded is not None:
            item.modifiers.remove(shaded)
        if item.type == "MESH" and item.data.library is None and not is_copy(item):
            changed += _restore_mesh(item.data, attributes) or shaded is not None
    remove_copies(target, of)
    changed += arrange(target)
    # Groups of shaders go with the last material that has them.
    for kind in (bpy.data.node_groups, bpy.data.materials, bpy.data.node_groups):
        for block in [b for b in kind if b.get(PREVIEW) and not b.users]:
            kind.remove(block)
    return changed


def _restore_mesh(mesh, attributes):
    colours = mesh.color_attributes
    before = mesh.get(ACTIVE_BEFORE)
    ours = [each for name in attributes for each in names_of_preview(name)]
    removed = [name for name in ours if name in colours] if before is not None else []
    for name in removed:
        colours.remove(colours[name])
    if before is not None:
        del mesh[ACTIVE_BEFORE]
        mesh.pop(PREVIEW_COLOURS, None)
        activate(mesh, before)
    return before is not None


def _shade(item, group):
    """The preview's modifier at the end of an object's stack, or none."""
    modifier = item.modifiers.get(PREVIEW)
    if group is None:
        if modifier is not None:
            item.modifiers.remove(modifier)
        return
    if modifier is None:
        modifier = item.modifiers.new(PREVIEW, "NODES")
        modifier.show_expanded = False
    if modifier.node_group != group:
        modifier.node_group = group


def _own_group(item, attribute):
    """The group that puts the relit copy of each material of an object in its place."""
    light, slots = light_name(attribute), [slot.material for slot in item.material_slots] or [None]
    return _shading_group(attribute, [relit_material(material, light) for material in slots])


def _shading_group(attribute, materials):
    """Geometry nodes that put a material on the faces of each slot, the last on all beyond."""
    for group in bpy.data.node_groups:
        ours = group.library is None and group.get(PREVIEW) == attribute
        if ours and group.bl_idname == "GeometryNodeTree" and _materials_of(group) == materials:
            return group
    group = bpy.data.node_groups.new(f"{attribute} preview", "GeometryNodeTree")
    group[PREVIEW] = attribute
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    nodes, links = group.nodes, group.links
    geometry = nodes.new("NodeGroupInput").outputs[0]
    # The last first: what has its new material lies beyond all slots.
    for slot in reversed(range(len(materials))):
        put = nodes.new("GeometryNodeSetMaterial")
        put.name, put.inputs["Material"].default_value = f"{slot:03d}", materials[slot]
        links.new(geometry, put.inputs["Geometry"])
        if slot > 0 or len(materials) > 1:
            is_last = slot == len(materials) - 1
            chosen = _compared(group, "GREATER_EQUAL" if is_last else "EQUAL", slot)
            links.new(chosen, put.inputs["Selection"])
        geometry = put.outputs[0]
    links.new(geometry, nodes.new("NodeGroupOutput").inputs[0])
    return group


def _compared(group, operation, slot):
    """A socket that says of which faces the number of their slot is this, or at least this."""
    compare = group.nodes.new("FunctionNodeCompare")
    compare.data_type, compare.operation = "INT", operation
    # Before 5.2 there is a pair of sockets for each type of data, then one that changes its own.
    one, other = (each for each in compare.inputs if each.enabled and each.type == "INT")
    other.default_value = slot
    index = group.nodes.new("GeometryNodeInputMaterialIndex")
    group.links.new(index.outputs[0], one)
    return compare.outputs[0]


def _materials_of(group):
    """The materials that a group of ours puts, by slot."""
    puts = [node for node in group.nodes if node.bl_idname == "GeometryNodeSetMaterial"]
    return [p.inputs["Material"].default_value for p in sorted(puts, key=lambda p: p.name)]
