"""The panel's section Light."""

from pathlib import Path

import bpy

from . import preview
from .panel_parts import Panel


class PRT_PT_light(Panel, bpy.types.Panel):
    bl_label = "Light"
    bl_parent_id = "PRT_PT_main"

    def draw(self, context):
        layout, settings = self.split(), context.scene.prt
        light = draw_sets(layout, settings)
        draw_environment(layout, light, settings)
        draw_lamps(layout, light)
        draw_rows(layout, context, light)


def draw_sets(layout, settings):
    """The lights that are kept by name; returns the one whose rows follow."""
    if not settings.sets:
        layout.operator("prt.light_set_add", icon="ADD")
        return settings
    row = layout.row()
    row.use_property_split = False
    row.template_list("PRT_UL_light_sets", "", settings, "sets", settings, "active_set", rows=3)
    side = row.column(align=True)
    side.operator("prt.light_set_add", text="", icon="ADD")
    side.operator("prt.light_set_remove", text="", icon="REMOVE")
    side.operator("prt.light_set_key", text="", icon="KEY_HLT")
    return settings.sets[min(settings.active_set, len(settings.sets) - 1)]


def draw_environment(layout, light, settings):
    """The world, an image or a studio light, how it is turned and how strong."""
    layout.row().prop(light, "light", expand=True)
    if light.light == "FILE":
        layout.prop(light, "file")
    elif light.light == "STUDIO":
        row = layout.row()
        row.use_property_split = False
        row.template_icon_view(light, "studio", show_labels=True, scale=4)
        row.label(text=Path(light.studio).stem.replace("_", " ").title())
    column = layout.column(align=True)
    column.use_property_decorate = True
    row = column.row(align=True)
    row.prop(light, "rotation")
    if light == settings:
        row.operator("prt.turntable", text="", icon="KEY_HLT")
    column.prop(light, "strength")


def draw_lamps(layout, light):
    """What is cast by shadow rays when relighting."""
    row = layout.row(align=True)
    row.use_property_split = False
    row.prop(light, "use_lamps")
    row.prop(light, "sharp_sun")
    if light.use_lamps or light.sharp_sun:
        row.prop(light, "lamp_samples")


def draw_rows(layout, context, light):
    """A row for each material that emits light, and in a set for each lamp."""
    column = layout.column(align=True)
    column.use_property_split = False
    for name in preview.emitters(preview.held(context.scene)):
        item = light.emitters.get(name)
        if item is not None:
            draw_emitter(column, item, name)
    if light.use_lamps:
        objects = context.scene.objects
        for item in getattr(light, "lamps", ()):
            if item.name in objects:
                draw_emitter(column, item, item.name)


def draw_emitter(column, item, name):
    """How strong, and in which colour, a material or lamp shines."""
    row = column.row(align=True)
    row.label(text=name, icon="LIGHT")
    row.prop(item, "recolour", text="", icon="COLOR")
    if item.recolour:
        row.prop(item, "colour", text="")
    row.prop(item, "strength", text="")


register, unregister = bpy.utils.register_classes_factory((PRT_PT_light,))
