"""Blender's lamps as `Lamp`s."""

from dataclasses import dataclass, replace

import bpy
import numpy as np

from prt_core.blender.compat import depsgraph_of, has_nodes, view_layer_of
from prt_core.blender.lamp_nodes import LampNodes
from prt_core.blender.lamp_object import LampObject
from prt_core.blender.light_linking import Linking, say_linked_surfaces
from prt_core.blender.stand_ins import renders
from prt_core.errors import PRTError
from prt_core.light.local import Lamp

_KINDS = {"POINT": "point", "SPOT": "spot", "AREA": "area", "SUN": "sun"}
# More bounces than these change nothing that can be seen.
ALL_BOUNCES = 64


def read_lamps(scene=None, messages=None, depsgraph=None):
    """Every lamp that lights diffuse surfaces in a render, in world space.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
    messages : list of str, optional
        Told what is not understood.
    depsgraph : bpy.types.Depsgraph, optional
        Where the scene is evaluated already, as for a render.

    Returns
    -------
    list of Lamp
    """
    messages = [] if messages is None else messages
    scene = scene or bpy.context.scene
    if depsgraph is None:
        depsgraph = depsgraph_of(view_layer_of(scene))
    seen = see_lamps(scene, depsgraph, messages)
    return [lamp_seen(each, scene, messages) for each in seen]


@dataclass
class SeenLamp:
    """A lamp as an evaluated scene has it, which lasts longer than that.

    Attributes
    ----------
    lamp : Lamp
        Without what its nodes do.
    nodes : LampNodes or None
    ignored : list of str
        What of it is not followed.
    """

    lamp: Lamp
    nodes: LampNodes | None
    ignored: list


def see_lamps(scene, depsgraph, messages):
    """The lamps of an evaluated scene as a list of `SeenLamp`; nothing is rendered for it."""
    rendered = rendering_objects(scene, depsgraph.view_layer)
    linking, seen, alone = Linking(depsgraph), [], set()
    for instance in depsgraph.object_instances:
        source = instance.object
        owner = instance.parent or source
        if source.type != "LIGHT":
            continue
        if instance.parent is None:
            alone.add(source.original.session_uid)
        if owner.original.session_uid in rendered and _shines(source, owner):
            matrix = np.array(instance.matrix_world, np.float64)
            number = None if instance.parent is None else instance.random_id
            seen.append(_see(scene, source, owner, matrix, linking, number))
    if depsgraph.mode == "VIEWPORT":
        # What is hidden in the viewport alone is not evaluated.
        for uid, item in rendered.items():
            if item.type == "LIGHT" and uid not in alone and _shines(item, item):
                seen.append(_see(scene, item, item, np.array(_matrix(item)), linking))
    say_linked_surfaces(depsgraph, rendered, messages)
    return seen


def lamp_seen(seen, scene, messages):
    """The `Lamp` of a `SeenLamp`, with what its nodes do; Cycles may render for it.

    Parameters
    ----------
    seen : SeenLamp
    scene : bpy.types.Scene
        Whose frame counts.
    messages : list of str
    """
    lamp, ignored = seen.lamp, list(seen.ignored)
    if seen.nodes is not None:
        try:
            emission, notes = seen.nodes.emission(scene)
            ignored += notes
            tables = {name: getattr(emission, name) for name in ("pattern", "texture", "falloff")}
            lamp = replace(lamp, power=lamp.power * emission.factor, **tables)
        except PRTError as error:
            ignored.append(f"its nodes ({error})")
    if ignored:
        messages.append(f"lamp '{lamp.name}': {', '.join(ignored)} ignored")
    return lamp


def world_left_out(lamps):
    """A list of messages on the suns that need shadow rays of their own: no world holds them."""
    return [
        f"lamp '{lamp.name}': a sun with linking, without shadow or of negative power is not in "
        "'--light world'; add --lamps"
        for lamp in lamps
        if lamp.kind == "sun" and not lamp.is_on_texels
    ]


def rendering_objects(scene, view_layer):
    """{session_uid: object} of those whose collections and own switch let them render.

    Those of a scene that stands as a set behind it as well.
    """
    items = {}

    def visit(layer):
        if not (layer.exclude or layer.collection.hide_render):
            items.update((o.session_uid, o) for o in layer.collection.objects if renders(o))
            for child in layer.children:
                visit(child)

    scene = scene.original
    visit(scene.view_layers[view_layer.name].layer_collection)
    while (scene := scene.background_set) is not None:
        visit(scene.view_layers[0].layer_collection)
    return items


def _shines(source, owner):
    """Whether a lamp's light meets diffuse surfaces at all."""
    # Cycles' own settings of what is evaluated may be old ones.
    data = source.data.original
    is_portal = data.type == "AREA" and data.cycles.is_portal
    visible = source.visible_diffuse and owner.visible_diffuse
    return visible and not is_portal and not source.original.hide_render


def _matrix(item):
    """Where an object that is not evaluated is, but for its constraints."""
    if item.parent is None or item.parent_type != "OBJECT":
        return item.matrix_basis if item.parent is None else item.matrix_world
    return _matrix(item.parent) @ item.matrix_parent_inverse @ item.matrix_basis


def _see(scene, source, owner, matrix, linking, random_id=None):
    data, ignored, nodes = source.data, [], None
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = matrix[:3, :3] / np.maximum(lengths, 1e-30)
    if not np.allclose(axes.T @ axes, np.eye(3), atol=1e-3):
        ignored.append("its shear")
    if data.original.cycles.max_bounces < ALL_BOUNCES:
        ignored.append(f"its limit of {data.original.cycles.max_bounces} bounces")
    settings = _shape(data, lengths)
    lamp = Lamp(
        _KINDS[data.type],
        _power(data, settings),
        matrix[:3, 3],
        axes,
        name=source.original.name,
        casts_shadow=data.use_shadow,
        highlights=source.visible_glossy and owner.visible_glossy,
        receivers=linking.named(source.light_linking.receiver_collection),
        blockers=linking.named(source.light_linking.blocker_collection),
        **settings,
    )
    if has_nodes(data):
        nodes = LampNodes(scene, data, matrix, LampObject.of(source, owner, random_id))
    return SeenLamp(lamp, nodes, ignored)


def _shape(data, lengths):
    settings = {}
    if data.type in {"POINT", "SPOT"}:
        # The radius is in Blender's units whatever the object's scale.
        settings |= {"radius": data.shadow_soft_size, "soft_falloff": data.use_soft_falloff}
    if data.type == "SPOT":
        settings |= {"cone": data.spot_size, "blend": data.spot_blend, "scale": tuple(lengths)}
    if data.type == "AREA":
        square = data.shape in {"SQUARE", "DISK"}
        size = np.array([data.size, data.size if square else data.size_y]) * lengths[:2]
        settings |= {
            "size": tuple(size),
            "ellipse": data.shape in {"DISK", "ELLIPSE"},
            "spread": data.spread,
        }
    if data.type == "SUN":
        settings["angle"] = data.angle
    return settings


def _power(data, shape):
    """(3,) float64: watts, of a sun W / m^2."""
    power = np.array(data.color[:], np.float64) * data.energy
    if getattr(data, "use_temperature", False):
        power = power * np.array(data.temperature_color[:])
    power = power * 2 ** getattr(data, "exposure", 0.0)
    if getattr(data, "normalize", True):
        return power
    # Cycles divides by the area of what shines only where the power is normalised.
    if data.type == "AREA":
        return power * np.prod(shape["size"]) * (np.pi / 4 if shape["ellipse"] else 1)
    if data.type == "SUN":
        return power * (np.pi * np.sin(data.angle / 2) ** 2 if data.angle else 1)
    radius = shape["radius"]
    return power * 4 * (np.pi * radius**2 if radius else 1)
