"""Blender's lamps as `Lamp`s."""

import bpy
import numpy as np

from prt_core.blender.compat import has_nodes, view_layer_of
from prt_core.blender.lamp_nodes import emission_of
from prt_core.blender.light_linking import Linking, say_linked_surfaces
from prt_core.errors import PRTError
from prt_core.light.local import Lamp

_KINDS = {"POINT": "point", "SPOT": "spot", "AREA": "area", "SUN": "sun"}
# More bounces than these change nothing that can be seen.
_ALL_BOUNCES = 64


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
        with bpy.context.temp_override(scene=scene, view_layer=view_layer_of(scene)):
            return read_lamps(scene, messages, bpy.context.evaluated_depsgraph_get())
    rendered = rendering_objects(scene, depsgraph)
    linking = Linking(depsgraph, rendered)
    lamps = []
    for instance in depsgraph.object_instances:
        source = instance.object
        owner = instance.parent or source
        if source.type != "LIGHT" or owner.original.session_uid not in rendered:
            continue
        if instance.show_self and _shines(source, owner):
            matrix = np.array(instance.matrix_world, np.float64)
            lamps.append(_lamp(scene, source, owner, matrix, linking, messages))
    say_linked_surfaces(depsgraph, rendered, messages)
    return lamps


def rendering_objects(scene, depsgraph):
    """{session_uid: object} of those whose collections and own switch let them render."""
    items = {}

    def visit(layer):
        if not (layer.exclude or layer.collection.hide_render):
            items.update(
                (item.session_uid, item) for item in layer.collection.objects if not item.hide_render
            )
            for child in layer.children:
                visit(child)

    visit(depsgraph.view_layer.layer_collection)
    return items


def _shines(source, owner):
    """Whether a lamp's light meets diffuse surfaces at all."""
    is_portal = source.data.type == "AREA" and source.data.cycles.is_portal
    visible = source.visible_diffuse and owner.visible_diffuse
    return visible and not is_portal and not source.original.hide_render


def _lamp(scene, source, owner, matrix, linking, messages):
    data, name = source.data, source.original.name
    ignored = []
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = matrix[:3, :3] / np.maximum(lengths, 1e-30)
    if not np.allclose(axes.T @ axes, np.eye(3), atol=1e-3):
        ignored.append("its shear")
    if data.cycles.max_bounces < _ALL_BOUNCES:
        ignored.append(f"its limit of {data.cycles.max_bounces} bounces")
    settings = _shape(data, lengths)
    power = _power(data, settings)
    if has_nodes(data):
        try:
            emission = emission_of(scene, source, matrix, ignored)
            power = power * emission.factor
            settings |= {name: getattr(emission, name) for name in ("pattern", "texture", "falloff")}
        except PRTError as error:
            ignored.append(f"its nodes ({error})")
    if ignored:
        messages.append(f"lamp '{name}': {', '.join(ignored)} ignored")
    return Lamp(
        _KINDS[data.type],
        power,
        matrix[:3, 3],
        axes,
        name=name,
        casts_shadow=data.use_shadow,
        receivers=linking.named(owner.light_linking.receiver_collection),
        blockers=linking.named(owner.light_linking.blocker_collection),
        **settings,
    )


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
