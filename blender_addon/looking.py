"""Buttons of what is looked at: exposure, Solid mode, and what there is to know of a bake."""

import bpy
from bpy.props import BoolProperty

from . import advice, preview, views
from .buttons import BakeButton, Button
from .panel_parts import wide_lines
from .panels import draw_remedy
from .work import status

# Pixels of the dialog.
_WIDTH = 640


class PRT_OT_fit_exposure(BakeButton, bpy.types.Operator):
    """Set the exposure so that hardly anything is burnt out, as the scene's view transform shows
    it"""

    bl_idname = "prt.fit_exposure"
    bl_label = "Fit Exposure"

    @classmethod
    def why_not(cls, context):
        held = preview.held(context.scene)
        if held is not None and held.radiance is None:
            return "Relight first: no colours are shown"
        return super().why_not(context)

    def execute(self, context):
        scene = context.scene
        held = preview.held(scene)
        if held is None or held.radiance is None:
            return self.fail("exposure: relight first, no colours are shown")
        stops = preview.fitting_stops(scene, held.radiance)
        if stops is None:
            return self.fail("exposure: everything is black; is there any light?")
        scene.prt.exposure = round(scene.prt.exposure + stops, 1)
        return {"FINISHED"}


class PRT_OT_shading(Button, bpy.types.Operator):
    """Show the colours in Solid mode, as they are; again: as it was before"""

    bl_idname = "prt.shading"
    bl_label = "Colours in Solid"
    bl_options = {"REGISTER"}
    object_mode = False

    def execute(self, _context):
        if views.shown():
            views.restore()
        else:
            views.show()
        return {"FINISHED"}


class PRT_OT_notes(bpy.types.Operator):
    """All there is to know before the scene is baked, with what helps against it"""

    bl_idname = "prt.notes"
    bl_label = "Good to Know"
    bl_options = {"INTERNAL"}

    of_bake: BoolProperty(
        name="Of the Bake", description="What the selected bake has to say of itself",
        options={"SKIP_SAVE"},
    )  # fmt: skip

    def invoke(self, context, _event):
        manager = context.window_manager
        return manager.invoke_props_dialog(self, width=_WIDTH, confirm_text="Close")

    def draw(self, context):
        layout, state = self.layout, status()
        if self.of_bake:
            at = state.active_bake
            told = state.bakes[at].notes if 0 <= at < len(state.bakes) else ""
        else:
            for text, helps, name in advice.warnings(context.scene):
                row = layout.row()
                icon = "ERROR" if helps else "INFO"
                wide_lines(row.column(), text, icon, _WIDTH * (0.7 if helps else 1), context)
                draw_remedy(row, helps, name)
            told = state.notes
        for text in told.split("\n") if told else ():
            wide_lines(layout, text, "DOT", _WIDTH, context)

    def execute(self, _context):
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory(
    (PRT_OT_fit_exposure, PRT_OT_shading, PRT_OT_notes)
)
