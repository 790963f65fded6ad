"""What all operators of the add-on have in common."""

import bpy
from bpy.props import BoolProperty

from . import work
from .work import has_window, status


def show_in_renders(what):
    """The switch of what is kept: whether renders show it."""
    return BoolProperty(
        name="Show in Renders",
        description=f"Objects show the {what} in Material Preview and renders, over their own "
        "materials; remove the modifier 'PRT Kept' to see these again",
    )


class Button:
    """Says in grey buttons why, and in one line what went wrong."""

    bl_options = {"REGISTER", "UNDO"}
    object_mode = True  # whether meshes are written, which Edit Mode forbids

    @classmethod
    def poll(cls, context):
        reason = cls.why_not(context)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    @classmethod
    def why_not(cls, context):
        """Why the button is grey, None where it is not."""
        if status().running:
            return f"{status().title} is under way"
        if cls.object_mode and context.mode.startswith("EDIT"):
            return "Leave Edit Mode first"
        return None

    def fail(self, error):
        self.report({"ERROR"}, str(error))
        work.say(str(error), True)
        return {"CANCELLED"}


class BakeButton(Button):
    """Needs a bake."""

    @classmethod
    def why_not(cls, context):
        if not context.scene.prt.loaded:
            return "Bake the scene, or load a bake, first"
        return super().why_not(context)


class Asks:
    """Long work whose options are asked for in a dialog where there is a window: the redo panel
    comes too late for them, and is folded away.

    A subclass stands before `LongWork`; it has `call`, its name in `bpy.ops.prt`, and `asked`, the
    names of its options.
    """

    confirmed: BoolProperty(description="Begin without a dialog", options={"HIDDEN", "SKIP_SAVE"})
    _asks = False

    def invoke(self, context, event):
        self._asks = has_window(context) and not self.confirmed
        if self._asks:
            return context.window_manager.invoke_props_dialog(self, confirm_text=self.title)
        return super().invoke(context, event)

    def draw(self, _context):
        self.layout.use_property_split = True
        for name in self.asked:
            self.layout.prop(self, name)

    def execute(self, context):
        if not self._asks:
            return super().execute(context)
        # Blender frees the operator of a dialog, so the work is another's.
        chosen = {name: getattr(self, name) for name in self.asked}
        try:
            getattr(bpy.ops.prt, self.call)("INVOKE_DEFAULT", confirmed=True, **chosen)
        except RuntimeError as error:
            return self.fail(str(error).removeprefix("Error: ").strip())
        return {"CANCELLED"}
