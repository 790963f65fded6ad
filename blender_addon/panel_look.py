"""The panel's section Look: what the colours look like, and from where they are seen."""

import bpy

from . import preview
from .panel_parts import Panel, lines


class PRT_PT_look(Panel, bpy.types.Panel):
    bl_label = "Look"
    bl_parent_id = "PRT_PT_main"

    def draw_header_preset(self, _context):
        self.layout.popover("PRT_PT_look_more", text="", icon="PREFERENCES")

    def draw(self, context):
        layout = self.split()
        draw_look(layout, context)
        draw_exposure(layout, context)
        draw_gloss(layout, context)


def draw_look(layout, context):
    """How the colours are shown, and the shading modes of the 3D view beside it."""
    settings, shading = context.scene.prt, getattr(context.space_data, "shading", None)
    column = layout.column(align=True)
    column.use_property_split = False
    column.row(align=True).prop(settings, "look", expand=True)
    row = column.row(align=True)
    if shading is not None:
        row.prop(shading, "type", text="", expand=True)
        if settings.look == "MATERIALS" and shading.type in {"SOLID", "WIREFRAME"}:
            row.label(text="See it in Material Preview")
    row.prop(settings, "live", toggle=True)


def draw_exposure(layout, context):
    """Exposure, and a word where most is burnt out."""
    row = layout.row(align=True)
    row.use_property_decorate = True
    row.prop(context.scene.prt, "exposure")
    row.operator("prt.fit_exposure", text="", icon="LIGHT_SUN")
    held = preview.held(context.scene)
    if held is not None and held.burnt > preview.MOST_BURNT:
        lines(layout, f"{held.burnt:.0%} of the scene is burnt out", "ERROR", context)
        layout.operator("prt.fit_exposure")


def draw_gloss(layout, context):
    """The switch of gloss and from where it is seen; the reason where there is none."""
    settings, held = context.scene.prt, preview.held(context.scene)
    if held is None:
        return
    missing = preview.no_gloss(held)
    if missing:
        lines(layout, missing, "INFO", context)
        return
    row = layout.row(align=True)
    row.use_property_split = False
    row.prop(settings, "show_gloss")
    if settings.show_gloss:
        row.prop(settings, "seen_from", expand=True)
        if settings.seen_from == "CAMERA":
            layout.prop(settings, "seen_by")


class PRT_PT_look_more(bpy.types.Panel):
    """Behind the gear: the attribute on the meshes."""

    bl_idname = "PRT_PT_look_more"
    bl_label = "Look"
    bl_space_type, bl_region_type = "VIEW_3D", "HEADER"
    bl_options = {"INSTANCED"}

    def draw(self, context):
        layout, settings = self.layout, context.scene.prt
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "attribute")
        layout.prop(settings, "domain")
        layout.prop(settings, "use_compressed")
        layout.operator("prt.shading", icon="SHADING_SOLID")


register, unregister = bpy.utils.register_classes_factory((PRT_PT_look_more, PRT_PT_look))
