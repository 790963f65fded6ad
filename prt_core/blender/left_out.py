"""What renders but is not baked, or not in full: volumes, true displacement, view layers, hair's
materials, holdouts, what linked libraries do not give; a line each."""

import bpy
import numpy as np

from prt_core.blender.compat import composites, has_nodes
from prt_core.blender.render_scene import rendered_layer
from prt_core.blender.stand_ins import (
    hidden_by_libraries,
    is_copy,
    rendered_objects,
    stands_in,
)

_DISPLACED = {"DISPLACEMENT", "BOTH"}
# What Cycles has unless it is told otherwise: diffuse bounces, transparent surfaces that a ray
# passes, and what indirect light is clamped to.
_USUAL_BOUNCES, _USUAL_PASSES, _USUAL_CLAMP = 4, 8, 10
# What Blender shows for a face without material.
NO_MATERIAL = (0.8, 0.8, 0.8)


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


def plain_colour(material):
    """The first colour of a material's shader where nothing is linked to it; None where it is."""
    if material is None:
        return NO_MATERIAL
    shader = surface_shader(material)
    if shader is None:
        return tuple(material.diffuse_color[:3])
    colour = next((s for s in shader.inputs if s.type == "RGBA"), None)
    if colour is None or colour.is_linked:
        return None
    return tuple(np.clip(colour.default_value[:3], 0, 1))


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


def scene_remarks(scene, kinds):
    """List of lines on a scene as a whole, before its objects are read.

    Parameters
    ----------
    scene : bpy.types.Scene
    kinds : set of str
        Types of the objects that are baked.
    """
    rendered = rendered_objects(scene)
    kept = [
        item.name
        for item in scene.objects
        if item.type in kinds and item.session_uid in rendered
        and not is_copy(item) and stands_in(item, rendered)
    ]  # fmt: skip
    lines = []
    if kept:
        few = ", ".join(kept[:4]) + (" …" if len(kept) > 4 else "")
        lines.append(
            f"{len(kept)} objects hold kept colours ({few}); not they, but the objects that "
            "they were made of are baked"
        )
    lines += [
        f"{item.name}: is hidden in renders, and not baked: in '{item.library.name}' a copy with "
        "colours stands in for it; link that as well, or press Restore there and save it"
        for item in hidden_by_libraries(scene)
    ]
    lines += layer_remarks(*rendered_layer(scene))
    return [*lines, *culling_remarks(scene), *render_remarks(scene), *missing_remarks()]


def say_copies(meshes, messages):
    """Say which objects' colours cannot go to their own meshes."""
    copies = [mesh.name for mesh in meshes if mesh.receives and not mesh.own_mesh]
    if copies:
        few = ", ".join(copies[:4]) + (" …" if len(copies) > 4 else "")
        messages.append(
            f"{len(copies)} objects are made by modifiers, curves, instances or libraries ({few});"
            " their colours go to realised copies in the collection 'PRT'"
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
    if not layer.use_sky:
        yield f"view layer '{layer.name}': its Environment is off, so that the world gives no light"
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


def render_remarks(scene):
    """Lines on settings of renders that change all of a picture, and that a bake does not have."""
    if scene.render.use_motion_blur:
        yield "renders have motion blur, a bake has none: it is of one moment"
    if scene.render.use_compositing and composites(scene):
        yield "renders go through the compositor's nodes, pictures of a bake do not"
    cycles = getattr(scene, "cycles", None)
    if cycles is None:
        return
    exposure, bounces = cycles.film_exposure, min(cycles.max_bounces, cycles.diffuse_bounces)
    if exposure != 1:
        way = f"--exposure {np.log2(exposure):.3g} is as much" if exposure > 0 else "they are black"
        yield f"renders have a film exposure of {exposure:g}, a bake has none; {way}"
    if bounces < _USUAL_BOUNCES:
        yield (
            f"renders end light after {bounces} diffuse bounces, a bake has all of them; "
            f"--bounces {bounces} has as many"
        )
    if cycles.transparent_max_bounces < _USUAL_PASSES:
        yield (
            f"renders end light behind {cycles.transparent_max_bounces} transparent surfaces, in a "
            "bake it passes all of them"
        )
    if cycles.use_fast_gi and cycles.fast_gi_method == "REPLACE":
        yield "renders have Fast GI in the place of bounces, a bake has the bounces"
    for kind, usual in (("direct", np.inf), ("indirect", _USUAL_CLAMP)):
        most = getattr(cycles, f"sample_clamp_{kind}")
        if 0 < most < usual:
            yield f"renders clamp {kind} light to {most:g}, a bake has all of it"


def holdout_remarks(source, owner, layer):
    """Lines on an object that is a hole in pictures, or shadows alone; to light it is as others.

    Parameters
    ----------
    source, owner : bpy.types.Object
        Whose geometry it is; its instancer, or itself.
    layer : bpy.types.ViewLayer
        Of the same evaluation.
    """
    if source.is_holdout or owner.is_holdout or owner.original.holdout_get(view_layer=layer):
        yield f"{owner.name}: is a holdout; renders have a hole there, pictures of a bake show it"
    elif source.is_shadow_catcher or owner.is_shadow_catcher:
        yield (
            f"{owner.name}: is a shadow catcher; renders have its shadows alone, "
            "pictures of a bake show it"
        )


def missing_remarks():
    """Lines on what is linked into the open file from libraries that do not give it."""
    for library in bpy.data.libraries:
        if library.is_missing:
            yield (
                f"library '{library.name}': its file '{bpy.path.abspath(library.filepath)}' is "
                "missing; what is linked from it is left out, as in a render"
            )
    for linked in (bpy.data.objects, bpy.data.collections, bpy.data.meshes, bpy.data.materials):
        for item in linked:
            if item.is_missing and not item.library.is_missing:
                yield f"{item.name}: is linked, but not in library '{item.library.name}' any more"


def _output(material):
    """The node that Cycles takes a material from, or None."""
    if material is None or not has_nodes(material):
        return None
    tree = material.node_tree
    return tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
