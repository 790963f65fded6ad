"""The preview's look: a bake's colours in every shading mode, and everything as it was before.

It changes nothing that `restore` cannot take back: materials stay on their objects and are covered
by a Set Material modifier; what realised copies stand in for is hidden and marked.
"""

import bpy

from prt_core.blender.colours import ACTIVE_BEFORE, activate, places_of
from prt_core.blender.identity import objects_by_place
from prt_core.blender.realised import PREVIEW, holds, preview_material, remove_copies
from prt_core.blender.stand_ins import COPY, arrange, is_copy


def show_colours(scene, attribute="PRT", material=True, places=None, names=None):
    """Show the colours of a bake in every shading mode: cover the materials of its objects.

    Parameters
    ----------
    scene : Scene
        Whose colours `write_all` has written.
    attribute : str
    material : bool
        Show them as emission in Material Preview and renders as well.
    places : dict of str -> (str, str), optional
        As `write_all` takes it.
    names : collection of str, optional
        Of the baked objects that are meant; default: all that receive.
    """
    group = _shading_group(attribute) if material else None
    places, objects = places_of(scene, places), objects_by_place()
    for item in scene.objects:
        meant = item.receives if names is None else item.name in names
        present = objects.get(places[item.name]) if item.own_mesh and meant else None
        if present is not None:
            _shade(present, group)


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
    for kind in (bpy.data.node_groups, bpy.data.materials):
        for block in [b for b in kind if b.get(PREVIEW) and not b.users]:
            kind.remove(block)
    return changed


def is_shaded(item):
    """Whether an object shows the preview's material over its own."""
    return PREVIEW in item.modifiers


def _restore_mesh(mesh, attributes):
    colours = mesh.color_attributes
    before = mesh.get(ACTIVE_BEFORE)
    removed = [name for name in attributes if name in colours] if before is not None else []
    for name in removed:
        colours.remove(colours[name])
    if before is not None:
        del mesh[ACTIVE_BEFORE]
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


def _shading_group(attribute):
    """Geometry nodes that put the emission material on everything."""
    for group in bpy.data.node_groups:
        if group.library is None and group.get(PREVIEW) == attribute:
            return group
    group = bpy.data.node_groups.new(f"{attribute} preview", "GeometryNodeTree")
    group[PREVIEW] = attribute
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    nodes, links = group.nodes, group.links
    start, end = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    put = nodes.new("GeometryNodeSetMaterial")
    put.inputs["Material"].default_value = preview_material(attribute)
    links.new(start.outputs[0], put.inputs["Geometry"])
    links.new(put.outputs[0], end.inputs[0])
    return group
