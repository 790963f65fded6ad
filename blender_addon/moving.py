"""What has moved since the bake: the button that bakes that alone, of all objects or of some."""

import bpy
from bpy.props import BoolProperty

from . import bakes, plan, preview
from .operators import Baking
from .shapes import chosen_names


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
        if self.selected:
            self.only = chosen_names(context, "selection", "objects, or bake all")
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


register, unregister = bpy.utils.register_classes_factory((PRT_OT_update,))
