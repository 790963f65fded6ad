"""What has moved since the bake: whether something has, and which objects a selection asks for."""

import bpy

from prt_core.errors import expect

from . import bakes, plan, preview


def has_changed(scene):
    """Whether the scene is not as in the bake that its button makes, as far as is known."""
    held, path = preview.held(scene), str(plan.output_path(scene))
    if held is not None and str(held.path) == path and held.warned:
        return True
    listed = bpy.context.window_manager.prt.bakes
    item = next((b for b in listed if b.path == path and b.complete), None)
    return item is not None and bakes.state(scene, item)[1] == "ERROR"


def selected(context):
    """Names of the baked objects that are selected; what they hold or instance goes with them.

    Raises
    ------
    PRTError
        None is.
    """
    names = {
        item.name_full
        for item in context.selected_objects
        if (item.type in plan.GEOMETRY or item.instance_type != "NONE") and not item.hide_render
    }
    expect(names, "selected: no object that is baked is selected; select some, or bake all")
    return sorted(names)
