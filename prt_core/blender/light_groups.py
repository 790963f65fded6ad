"""Lights of a scene, each in a light group of its own: Cycles then renders each apart."""

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace

import bpy

from prt_core.blender.identity import UniqueNames, by_uid
from prt_core.blender.operator_context import context_of
from prt_core.blender.passes.traces import switched
from prt_core.blender.render_scene import rendered_world
from prt_core.blender.stand_ins import rendered_objects
from prt_core.errors import expect

_WORLD = "world"


@dataclass(frozen=True)
class Light:
    """A light of a scene.

    Attributes
    ----------
    name : str
    kind : {"lamp", "object", "world"}
    uid : int
        `session_uid` of the object, or of the world.
    """

    name: str
    kind: str
    uid: int


def lights_of(scene, emitting, messages):
    """The lights of a scene: its lamps, objects that emit, and the world.

    Parameters
    ----------
    scene : bpy.types.Scene
    emitting : sequence of bpy.types.Object
    messages : list of str
        Told what gives no light.

    Returns
    -------
    list of Light

    Raises
    ------
    PRTError
        There is none.
    """
    rendered, lights = rendered_objects(scene), []
    instanced = _instanced(scene)
    for item in bpy.data.objects:
        if item.type != "LIGHT" or item.session_uid not in rendered | instanced:
            continue
        if item.data.energy == 0:
            messages.append(f"lamp '{item.name_full}': has no power, so there is no field of it")
            continue
        lights.append(Light(item.name_full, "lamp", item.session_uid))
    lights += [Light(item.name_full, "object", item.session_uid) for item in emitting]
    world = rendered_world(scene)
    if world is not None and not _is_black(world):
        lights.append(Light(_WORLD, "world", world.session_uid))
    expect(
        lights,
        f"scene '{scene.name}': --lamps: nothing in it gives light; add a lamp, a world or a "
        "material that emits",
    )
    # A lamp may be called as the world is.
    names = UniqueNames()
    return [replace(light, name=names.give(light.name)) for light in lights]


def _instanced(scene):
    """`session_uid` of what collections that are instanced hold."""
    uids = set()
    for item in scene.objects:
        if item.instance_type == "COLLECTION" and item.instance_collection is not None:
            uids.update(part.session_uid for part in item.instance_collection.all_objects)
    return uids


def _is_black(world):
    """Whether a world is one plain colour without light."""
    if world.node_tree is None:
        return not any(world.color)
    output = world.node_tree.get_output_node("CYCLES") or world.node_tree.get_output_node("ALL")
    if output is None or not (output.inputs["Surface"].links or output.inputs["Volume"].links):
        return True
    if output.inputs["Volume"].links:
        return False
    node = output.inputs["Surface"].links[0].from_node
    if node.type != "BACKGROUND":
        return False
    strength, colour = node.inputs["Strength"], node.inputs["Color"]
    dark = not strength.is_linked and strength.default_value == 0
    return dark or (not colour.is_linked and not any(colour.default_value[:3]))


def group_names(lights):
    """The name of the group of each of some lights."""
    return [f"prt{number}" for number in range(len(lights))]


@contextmanager
def grouped_lights(scene, lights):
    """While it lasts, each light is in a group of its own of the scene's one view layer.

    The groups are called as `group_names` says.

    Parameters
    ----------
    scene : bpy.types.Scene
        A copy; the lights' own groups are put back.
    lights : sequence of Light
    """
    layer, groups = scene.view_layers[0], group_names(lights)
    with ExitStack() as stack:
        with context_of(scene):
            while len(layer.lightgroups):
                layer.active_lightgroup_index = 0
                bpy.ops.scene.view_layer_remove_lightgroup()
            for name in groups:
                bpy.ops.scene.view_layer_add_lightgroup(name=name)
        for light, name in zip(lights, groups, strict=True):
            owners = bpy.data.worlds if light.kind == _WORLD else bpy.data.objects
            owner = by_uid(owners, light.uid)
            expect(owner is not None, f"light '{light.name}': was removed meanwhile")
            stack.enter_context(switched(owner, "lightgroup", name))
        yield
