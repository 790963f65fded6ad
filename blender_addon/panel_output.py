"""The panel's section Keep & Export: what is done with the colours next."""

import bpy

from .panel_parts import Panel


class PRT_PT_output(Panel, bpy.types.Panel):
    bl_label = "Keep & Export"
    bl_parent_id = "PRT_PT_main"

    def draw(self, context):
        draw_keep(self.layout, context)
        draw_files(self.layout, context)


def draw_keep(layout, context):
    """What stays in the .blend."""
    keep = layout.operator("prt.keep", text="Keep Colours…", icon="COLOR")
    keep.domain = context.scene.prt.domain
    layout.operator("prt.occlusion", text="Occlusion to Attribute…", icon="SHADING_RENDERED")


def draw_files(layout, context):
    """What goes to files of its own."""
    column = layout.column(align=True)
    if context.scene.prt.sets:
        column.operator("prt.export_lights", text="Export Lights…", icon="LIGHT")
    column.operator("prt.export", text="Export Sequence…", icon="EXPORT")
    column.operator("prt.export_glb", text="Export Relit glTF…", icon="EXPORT")
    column.operator("prt.web_page_dialog", text="Export Web Page…", icon="URL")
    column.operator("prt.lightmap", text="Bake Lightmap…", icon="UV")


register, unregister = bpy.utils.register_classes_factory((PRT_PT_output,))
