"""The preview's look: a bake's colours in every shading mode, and everything as it was before.

It changes nothing that `restore` cannot take back: materials stay on their objects and are covered
by a Set Material modifier; originals of realised copies are hidden and marked.
"""

from contextlib import contextmanager

import bpy

from prt_core.blender.colours import (
    ACTIVE_BEFORE,
    COLLECTION,
    PREVIEW,
    activate,
    emission_material,
    is_copy,
    remove_copies,
)
from prt_core.blender.compat import view_layer_of

# Custom property of originals that are hidden behind their copies.
_HIDDEN = "prt_hidden"


def show_colours(scene, attribute="PRT", material=True, renamed=None, target=None):
    """Show a bake's colours in every shading mode: cover materials, hide copied originals.

    Parameters
    ----------
    scene : Scene
        Whose colours `write_all` has written.
    attribute : str
    material : bool
        Show them as emission in Material Preview and renders as well.
    renamed : dict of str -> str, optional
    target : bpy.types.Scene, optional

    Returns
    -------
    list of str
        What could not be shown, for people.
    """
    target = target or bpy.context.scene
    view_layer = view_layer_of(target)
    own = [item for item in scene.objects if item.own_mesh and item.receives]
    messages = []
    group = _shading_group(attribute) if material else None
    owners = set()
    for item in own:
        there = bpy.data.objects.get((renamed or {}).get(item.name, item.name))
        owners.add(item.owner)
        if there is not None:
            _shade(there, group)
    for item in scene.objects:
        there = bpy.data.objects.get(item.owner)
        if item.own_mesh or not item.receives or there is None:
            continue
        if item.owner in owners or there.library is not None:
            messages.append(f"{item.owner}: cannot be hidden behind its copy")
            continue
        if not there.get(_HIDDEN):
            there[_HIDDEN] = 2 if there.hide_render else 1
            there.hide_render = True
            if there.name in view_layer.objects:
                there.hide_set(True, view_layer=view_layer)
    return messages


def restore(target=None, attributes=()):
    """Take the preview back: materials, visibility, active colours; copies are removed.

    Parameters
    ----------
    target : bpy.types.Scene, optional
    attributes : sequence of str
        Colour attributes to remove as well.

    Returns
    -------
    int
        How many objects changed.
    """
    target = target or bpy.context.scene
    changed = 0
    for item in list(target.objects):
        shaded = item.modifiers.get(PREVIEW) if item.type == "MESH" else None
        if shaded is not None:
            item.modifiers.remove(shaded)
        if item.get(_HIDDEN):
            item.hide_render = item[_HIDDEN] == 2
            del item[_HIDDEN]
            for layer in target.view_layers:
                if item.name in layer.objects:
                    item.hide_set(False, view_layer=layer)
            changed += 1
        if item.type == "MESH" and item.data.library is None and not is_copy(item):
            changed += _restore_mesh(item.data, attributes) or shaded is not None
    home = bpy.data.collections.get(COLLECTION)
    if home is not None and home in target.collection.children_recursive:
        changed += remove_copies(home)
        if not home.objects and not home.children:
            bpy.data.collections.remove(home)
    for kind in (bpy.data.node_groups, bpy.data.materials):
        for block in [b for b in kind if b.get(PREVIEW) and not b.users]:
            kind.remove(block)
    return changed


def is_shaded(item):
    """Whether an object shows the preview's material over its own."""
    return PREVIEW in item.modifiers


def renders(item):
    """Whether an object renders, were it not for the preview."""
    return not item.hide_render or bool(item.get(_HIDDEN))


def hides_originals(scene):
    """Whether a preview hides objects behind their copies."""
    return any(item.get(_HIDDEN) for item in scene.objects)


@contextmanager
def originals_shown(scene, view_layer):
    """The originals of realised copies as they are without the preview, for as long as it lasts."""
    hidden = [o for o in scene.objects if o.get(_HIDDEN)]
    for item in hidden:
        item.hide_set(False, view_layer=view_layer)
    if hidden:
        view_layer.update()
    try:
        yield
    finally:
        for item in hidden:
            item.hide_set(True, view_layer=view_layer)


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
    name = f"{attribute} preview"
    group = bpy.data.node_groups.get(name)
    if group is not None and group.get(PREVIEW):
        return group
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group[PREVIEW] = True
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    nodes, links = group.nodes, group.links
    start, end = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    put = nodes.new("GeometryNodeSetMaterial")
    put.inputs["Material"].default_value = emission_material(attribute)
    links.new(start.outputs[0], put.inputs["Geometry"])
    links.new(put.outputs[0], end.inputs[0])
    return group
