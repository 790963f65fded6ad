"""What has moved since the bake: the button that bakes that alone, of all objects or of some."""

import bpy
from bpy.props import BoolProperty

from prt_core.errors import expect

from . import bakes, plan, preview
from .operators import Baking


class PRT_OT_update(Baking, bpy.types.Operator):
    """Bake only what has changed since: points of objects that were moved, edited or added, and
    what the others see of them"""

    bl_idname = "prt.update"
    bl_label = "Bake What Moved"

    update = True

    selected: BoolProperty(
        name="Selection Only", description="Points of selected objects alone: others stay as baked",
        options={"SKIP_SAVE"},
    )  # fmt: skip

    def steps(self, context, pace):
        self.only = selected(context) if self.selected else None
        return (yield from super().steps(context, pace))


def has_changed(scene):
    """Whether the scene is not as in the bake that its button makes, as far as is known."""
    held, path = preview.held(scene), str(plan.output_path(scene))
    if held is not None and str(held.path) == path:
        # A bake of a selection has left the others.
        left = (held.bake.report.get("reused") or {}).get("left_alone")
        if held.warned or left:
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


register, unregister = bpy.utils.register_classes_factory((PRT_OT_update,))
