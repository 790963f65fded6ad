"""What renders but is not baked: volumes, true displacement, view layers; a line each."""

from prt_core.blender.compat import has_nodes

_DISPLACED = {"DISPLACEMENT", "BOTH"}


def surface_kind(material):
    """(whether it has a surface, whether it has a volume) of a material, or of none."""
    output = _output(material)
    if output is None:
        return True, False
    surface, volume = output.inputs["Surface"].is_linked, output.inputs["Volume"].is_linked
    # Without both of them it is black, but solid.
    return surface or not volume, volume


def surface_shader(material):
    """The node that feeds a material's surface, or None."""
    output = _output(material)
    socket = output.inputs["Surface"] if output is not None else None
    while socket is not None and socket.is_linked:
        node = socket.links[0].from_node
        if node.type != "REROUTE":
            return node
        socket = node.inputs[0]
    return None


def material_remarks(name, materials):
    """Lines on what an object's materials do to its shape that is not baked.

    Parameters
    ----------
    name : str
        Of the object.
    materials : sequence of bpy.types.Material or None
    """
    for material in materials:
        if material is None:
            continue
        _, volume = surface_kind(material)
        if volume:
            yield f"{name}: its volume is not baked"
        output = _output(material)
        displaced = getattr(material, "displacement_method", "BUMP") in _DISPLACED
        if displaced and output is not None and output.inputs["Displacement"].is_linked:
            yield (
                f"{name}: true displacement by its material is not baked; apply it as a Displace "
                "modifier"
            )


def layer_remarks(layer, others):
    """Lines on the view layers of a scene.

    Parameters
    ----------
    layer : bpy.types.ViewLayer
        That is baked.
    others : list of str
        Those that render as well.
    """
    if not layer.use:
        yield f"view layer '{layer.name}': is off in renders, as all are; it is baked all the same"
    if others:
        names = ", ".join(map(repr, others[:3])) + (" …" if len(others) > 3 else "")
        yield f"view layer '{layer.name}' is baked; {names} render as well and are not"


def culling_remarks(scene):
    """Lines on objects that Cycles leaves out by where the camera is."""
    cycles = getattr(scene, "cycles", None)
    if not scene.render.use_simplify or cycles is None:
        return
    for kind in ("camera", "distance"):
        if not getattr(cycles, f"use_{kind}_cull", False):
            continue
        for item in scene.objects:
            if getattr(getattr(item, "cycles", None), f"use_{kind}_cull", False):
                yield f"{item.name}: is baked, though renders may cull it by {kind}"


def _output(material):
    """The node that Cycles takes a material from, or None."""
    if material is None or not has_nodes(material):
        return None
    tree = material.node_tree
    return tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
