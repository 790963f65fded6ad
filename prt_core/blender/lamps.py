"""Blender's lamps as `Lamp`s."""

import bpy
import numpy as np

from prt_core.blender.compat import has_nodes, view_layer_of
from prt_core.light.local import Lamp

_KINDS = {"POINT": "point", "SPOT": "spot", "AREA": "area", "SUN": "sun"}


def read_lamps(scene=None, messages=None, depsgraph=None):
    """Every lamp that renders, in world space; what is not understood goes to `messages`.

    Parameters
    ----------
    scene : bpy.types.Scene, optional
    messages : list of str, optional
    depsgraph : bpy.types.Depsgraph, optional
        Where the scene is evaluated already, as for a render.

    Returns
    -------
    list of Lamp
    """
    messages = [] if messages is None else messages
    if depsgraph is None:
        scene = scene or bpy.context.scene
        with bpy.context.temp_override(scene=scene, view_layer=view_layer_of(scene)):
            return read_lamps(scene, messages, bpy.context.evaluated_depsgraph_get())
    lamps = []
    for instance in depsgraph.object_instances:
        source = instance.object
        owner = instance.parent or source
        if source.type == "LIGHT" and not (owner.original.hide_render or source.hide_render):
            lamps.append(_lamp(source, np.array(instance.matrix_world), messages))
    return lamps


def _lamp(source, matrix, messages):
    data = source.data
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = matrix[:3, :3] / np.maximum(lengths, 1e-30)
    colour = np.array(data.color[:], np.float64)
    if getattr(data, "use_temperature", False):
        colour = colour * np.array(data.temperature_color[:])
    power = colour * data.energy * 2 ** getattr(data, "exposure", 0.0)
    ignored = []
    if has_nodes(data):
        used = [n for n in data.node_tree.nodes if n.type not in {"OUTPUT_LIGHT", "EMISSION"}]
        emission = [n for n in data.node_tree.nodes if n.type == "EMISSION"]
        if len(emission) == 1 and not any(s.is_linked for s in emission[0].inputs):
            power = power * np.array(emission[0].inputs["Color"].default_value[:3])
            power = power * emission[0].inputs["Strength"].default_value
        if used:
            ignored.append("nodes " + ", ".join(n.name for n in used))
    if data.type == "AREA" and data.spread < np.pi - 1e-3:
        ignored.append("spread")
    if not np.allclose(axes.T @ axes, np.eye(3), atol=1e-3):
        ignored.append("its shear")
    if not getattr(data, "use_shadow", True):
        ignored.append("its shadowless setting")
    if not getattr(data, "normalize", True):
        ignored.append("its power by radiance")
    if not source.visible_diffuse:
        ignored.append("its ray visibility")
    if source.light_linking.receiver_collection or source.light_linking.blocker_collection:
        ignored.append("its light linking")
    if power.min() < 0:
        ignored.append("its negative power")
    if ignored:
        messages.append(f"lamp '{source.name}': {', '.join(ignored)} ignored")
    settings = {}
    if data.type in {"POINT", "SPOT"}:
        # The radius is in Blender's units whatever the object's scale.
        settings |= {"radius": data.shadow_soft_size, "soft_falloff": data.use_soft_falloff}
    if data.type == "SPOT":
        settings |= {"cone": data.spot_size, "blend": data.spot_blend, "scale": tuple(lengths)}
    if data.type == "AREA":
        square = data.shape in {"SQUARE", "DISK"}
        size = np.array([data.size, data.size if square else data.size_y]) * lengths[:2]
        settings |= {"size": tuple(size), "ellipse": data.shape in {"DISK", "ELLIPSE"}}
    if data.type == "SUN":
        settings["angle"] = data.angle
    return Lamp(
        _KINDS[data.type],
        np.maximum(power, 0),
        matrix[:3, 3],
        axes,
        name=source.original.name,
        **settings,
    )
