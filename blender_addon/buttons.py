"""What all operators of the add-on have in common."""

from . import work
from .work import status


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
