"""The light field's part of the panel. Drawing only reads."""

import bpy

from prt_core.blender.compat import custom_camera_missing

from . import light_fields, plan
from .panel_parts import Panel, lines, notes
from .work import status


class PRT_PT_light_field(Panel, bpy.types.Panel):
    bl_label = "Light Field"
    bl_parent_id = "PRT_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, scene = self.split(), context.scene
        settings = scene.prt.field
        self._bake(context, layout)
        shown = light_fields.held(scene)
        if shown is not None and shown.warned:
            lines(layout, shown.warned, "ERROR", context)
        if light_fields.present(scene):
            layout.row().prop(settings, "follow", expand=True)
            if shown is not None and shown.has_compressed:
                layout.prop(settings, "use_compressed")
        layout.operator("prt.light_field_compress", text="Compress…", icon="FILE_ARCHIVE")
        if light_fields.present(scene):
            layout.operator("prt.light_field_clear", icon="LOOP_BACK")

    def _bake(self, context, layout):
        settings, missing = context.scene.prt.field, custom_camera_missing()
        column = layout.column()
        column.enabled = not status().running
        if missing is None:
            column.prop(settings, "angles")
            column.prop(settings, "samples")
            column.prop(settings, "denoise")
        column.prop(settings, "each")
        column.prop(settings, "name")
        if missing is None:
            count = len(context.selected_objects)
            text = f"Bake Light Field of {count} Selected"
            column.operator("prt.light_field_bake", text=text, icon="RENDER_STILL")
            return
        lines(layout, f"Light field: {missing}", "INFO", context)
        if context.scene.prt.loaded:
            button = layout.operator(
                "prt.light_field_bake", text="Light Field of the Bake", icon="RENDER_STILL"
            )
            button.from_bake = True
        else:
            text = "Or bake the scene: then its own transport gives one"
            lines(layout, text, "BLANK1", context)


class PRT_PT_field_lamps(Panel, bpy.types.Panel):
    bl_label = "Lights"
    bl_parent_id = "PRT_PT_light_field"

    @classmethod
    def poll(cls, context):
        return light_fields.held(context.scene) is not None

    def draw(self, context):
        lamps = context.scene.prt.field.lamps
        column = self.layout.column(align=True)
        for name in light_fields.held(context.scene).field.lights:
            lamp = lamps.get(name)
            if lamp is not None:
                row = column.row(align=True)
                row.label(text="All Lights" if name == "all" else name, icon="LIGHT")
                row.prop(lamp, "colour", text="")
                row.prop(lamp, "strength", text="")


class PRT_PT_field_list(Panel, bpy.types.Panel):
    bl_label = "Light Fields"
    bl_parent_id = "PRT_PT_light_field"

    def draw(self, context):
        layout, state = self.layout, status()
        row = layout.row()
        row.template_list("PRT_UL_fields", "", state, "fields", state, "active_field", rows=2)
        side = row.column(align=True)
        side.operator("prt.refresh", text="", icon="FILE_REFRESH")
        if not 0 <= state.active_field < len(state.fields):
            layout.label(text=f"None in {plan.folder(context.scene).name}")
            return
        item = state.fields[state.active_field]
        side.operator("prt.remove", text="", icon="TRASH").filepath = item.path
        row = layout.row()
        row.enabled = item.complete
        row.operator("prt.light_field_load", icon="IMPORT").filepath = item.path
        text = item.unreadable or (item.about if item.complete else "stopped")
        lines(layout, text, "ERROR" if item.unreadable else "BLANK1", context)
        if item.compressed:
            row = layout.row()
            lines(row, f"compressed: {item.compressed}", "BLANK1", context)
            if light_fields.path_of(context.scene) == item.path:
                button = row.operator("prt.light_field_compress", text="", icon="X")
                button.method, button.confirmed = "none", True
        notes(layout, item.notes, context)


class PRT_UL_fields(bpy.types.UIList):
    """The light fields of the folder; the one that is shown has an eye."""

    def draw_item(self, context, layout, _data, item, _icon, _active, _property, _index):
        row = layout.row(align=True)
        shown = light_fields.path_of(context.scene) == item.path
        state = "CHECKMARK" if item.complete else "ERROR" if item.unreadable else "PAUSE"
        row.label(text=item.name, icon="HIDE_OFF" if shown else state)
        row.label(text=f"{item.megabytes:.1f} MB")


register, unregister = bpy.utils.register_classes_factory(
    (PRT_UL_fields, PRT_PT_light_field, PRT_PT_field_lamps, PRT_PT_field_list)
)
