"""What glossy rays meet otherwise than diffuse ones, which alone are cast: a line each."""

from prt_core.blender.compat import has_nodes
from prt_core.blender.node_trees import all_nodes
from prt_core.blender.passes.closures import LEFT_OUT
from prt_core.blender.passes.light_paths import tells_gloss_apart
from prt_core.blender.render_scene import rendered_world
from prt_core.blender.stand_ins import is_copy, rendered_objects

# What reflections show of each kind, where glossy rays do not meet it, and where only they do.
_LINES = {
    "surface": (
        "reflections show it all the same",
        "reflections leave it out",
    ),
    "lamp": (
        None,
        "its highlights are left out",
    ),
    "sun": (
        "reflections of '--light world' show it all the same",
        "its highlights are left out",
    ),
    "world": (
        "reflections show it all the same",
        "reflections leave it out",
    ),
}
_HIDDEN, _ALONE = "glossy rays do not meet it, diffuse ones do", "only glossy rays meet it"


def glossy_remarks(scene):
    """List of lines on what reflections show otherwise than a render.

    Parameters
    ----------
    scene : bpy.types.Scene
    """
    rendered, lines = rendered_objects(scene), []
    for item in scene.objects:
        if item.session_uid in rendered and not is_copy(item):
            data = item.data
            kind = "surface" if item.type != "LIGHT" else "sun" if data.type == "SUN" else "lamp"
            lines += _line(item.name, kind, item.visible_diffuse, item.visible_glossy)
            lines += _by_nodes(item.name, data) if item.type == "LIGHT" else []
    world = rendered_world(scene)
    if world is not None:
        rays = world.cycles_visibility
        lines += _line(f"world '{world.name}'", "world", rays.diffuse, rays.glossy)
        lines += _by_nodes(f"world '{world.name}'", world)
    return lines


def _line(name, kind, diffuse, glossy):
    said = None if diffuse == glossy else _LINES[kind][0 if diffuse else 1]
    if said is not None:
        yield f"{name}: {_HIDDEN if diffuse else _ALONE}; {said}"


def _by_nodes(name, data):
    if has_nodes(data) and any(
        node.type == "LIGHT_PATH" and tells_gloss_apart(node) for node in all_nodes(data.node_tree)
    ):
        yield f"{name}: {LEFT_OUT['glossy rays']}"
