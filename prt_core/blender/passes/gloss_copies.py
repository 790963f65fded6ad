"""Copies of materials that tell what they reflect, which objects have for as long as it lasts."""

from contextlib import ExitStack, contextmanager
from functools import partial

import bpy

from prt_core.blender.casters import mark_temporary, remove_blocks
from prt_core.blender.compat import has_nodes
from prt_core.blender.passes.cryptomatte import name_number
from prt_core.blender.passes.gloss_tree import add_gloss_outputs


class GlossCopies:
    """What stands for materials meanwhile.

    Attributes
    ----------
    material : dict of int -> bpy.types.Material
        By the `session_uid` of the own one.
    number : dict of int -> int
        `name_number` of a copy -> that of the own one.
    planes : set of str
        That any of them writes (see `closures.PLANES`).
    """

    def __init__(self):
        self.material, self.number, self.planes = {}, {}, set()


@contextmanager
def telling_gloss(materials):
    """Let objects have copies of materials that write what they reflect.

    What is linked from libraries keeps its own materials, as nobody can put others there; these get
    nodes that are taken away again.

    Parameters
    ----------
    materials : iterable of bpy.types.Material

    Yields
    ------
    GlossCopies
    """
    copies, made = GlossCopies(), []

    def keep(block):
        mark_temporary(block)
        made.append(block)

    materials = [material for material in materials if has_nodes(material)]
    users = bpy.data.user_map(subset=materials) if materials else {}
    with ExitStack() as undo:
        undo.callback(lambda: remove_blocks(made))
        for material in materials:
            if material.library is not None:
                undo.enter_context(_as_it_was(material.node_tree))
                told = material
            else:
                told = material.copy()
                keep(told)
                _put(material, told, users.get(material, ()), undo)
                copies.number[name_number(told.name)] = name_number(material.name)
            copies.material[material.session_uid] = told
            copies.planes |= add_gloss_outputs(told.node_tree, keep)
        yield copies


def _put(material, other, users, undo):
    """Let all that a scene shows with a material have another one, until it is undone."""
    setters = _setters(material, users)
    if setters is None:
        # Blender knows all places, but goes through the whole file.
        undo.callback(other.user_remap, material)
        material.user_remap(other)
        return
    for put in setters:
        put(other)
        undo.callback(put, material)


def _setters(material, users):
    """Functions that put a material where one is; None where some have it in other places."""
    setters = []
    for user in users:
        if isinstance(user, bpy.types.Object):
            own = [s for s in user.material_slots if s.link == "OBJECT" and s.material == material]
            if not own or len(user.modifiers):
                return None
            setters += [partial(setattr, slot, "material") for slot in own]
        elif hasattr(user, "materials"):
            places = [n for n, each in enumerate(user.materials) if each == material]
            setters += [partial(user.materials.__setitem__, place) for place in places]
        elif not isinstance(user, bpy.types.Scene):
            return None
    return setters


@contextmanager
def _as_it_was(tree):
    """Nodes that are added to a tree, and groups of its nodes, are as before in the end."""
    before = {node.as_pointer() for node in tree.nodes}
    groups = {node: node.node_tree for node in tree.nodes if node.type == "GROUP"}
    try:
        yield
    finally:
        for node in [node for node in tree.nodes if node.as_pointer() not in before]:
            tree.nodes.remove(node)
        for node, group in groups.items():
            if node.node_tree != group:
                node.node_tree = group
