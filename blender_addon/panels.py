"""The panel in the 3D view's sidebar: Bake. Drawing only reads.

Each section below it is a file: `panel_light`, `panel_look`, `panel_output`, `panel_bakes`; each
group of rows in it a function. All of them, open, are at most one window of 1080 pixels high: what
is set seldom is in a sub-panel that is closed at first, or behind the gear of its section.
"""

import bpy

from prt_core.blender.stand_ins import is_copy, is_kept

from . import advice, bakes, moving, plan, preview
from .panel_parts import Panel, clipped_lines, lines, megabytes, seconds
from .work import status

# Warnings that the panel shows; the others are behind a button.
_GRAVEST = 2


class PRT_PT_main(Panel, bpy.types.Panel):
    bl_idname = "PRT_PT_main"
    bl_label = "PRT Relight"

    def draw(self, context):
        layout, state, scene = self.layout, status(), context.scene
        draw_quality(layout, scene)
        draw_button(layout, scene)
        plan.want(scene)
        draw_cost(layout, scene)
        draw_warnings(layout, context)
        if state.message:
            lines(layout, state.message, "ERROR" if state.failed else "INFO", context)
        held = preview.held(scene)
        if held is not None and held.warned:
            lines(layout, held.warned, "ERROR", context)
        row = layout.row(align=True)
        if scene.prt.loaded:
            row.operator("prt.relight", icon="LIGHT_SUN")
        if preview.present(scene):
            row.operator("prt.clear", icon="LOOP_BACK")


def draw_quality(layout, scene):
    """Draft, Final or Custom, and whether gloss is baked."""
    column = layout.column(align=True)
    column.enabled = not status().running
    column.row(align=True).prop(scene.prt, "quality", expand=True)
    column.row().prop(scene.prt, "gloss", text="Gloss of metal and shiny surfaces")


def draw_button(layout, scene):
    """The button, or how far it has come."""
    state = status()
    row = layout.row(align=True)
    row.scale_y = 1.4
    if state.running:
        row.progress(factor=state.done, text=f"{state.title}: {state.stage}")
        row.operator("prt.cancel", text="", icon="CANCEL")
        return
    text = "Go On Baking" if bakes.goes_on(scene) else "Bake"
    row.operator("prt.bake", text=text, icon="RENDER_STILL")
    if bakes.is_there(scene):
        row.operator("prt.bake", text="", icon="FILE_REFRESH").restart = True
        draw_update(layout, scene)


def draw_update(layout, scene):
    """The button that bakes only what has changed, where something has."""
    if not moving.has_changed(scene):
        return
    row = layout.row(align=True)
    button = row.operator("prt.update", icon="CON_LOCLIKE")
    button.selected = scene.prt.selection_only
    row.prop(scene.prt, "selection_only", text="", icon="RESTRICT_SELECT_OFF")


def draw_cost(layout, scene):
    """What the bake will cost, in one line."""
    planned, holds = plan.of(scene)
    row = layout.row()
    if planned is None or planned.cost is None:
        row.label(text="Not checked yet" if planned is None else "Nothing to bake")
    else:
        cost = planned.cost
        text = f"{cost.points:,} points, ~{seconds(cost.seconds)}, {megabytes(cost.memory_bytes)}"
        if scene.prt.refine:
            text += f", up to {scene.prt.refine_vertices:.3g} x refined"
        row.label(text=text if holds else f"Was {text}")
    row.operator("prt.refresh", text="", icon="FILE_REFRESH")


def draw_warnings(layout, context):
    """The gravest of what is to be known before baking, and where the others are."""
    warnings, held = advice.warnings(context.scene), preview.held(context.scene)
    # What is baked as it is says no more of itself than it has to.
    gravest = 0 if held is not None and not held.warned else _GRAVEST
    for text, helps, name in warnings[:gravest]:
        column = layout.column(align=True)
        clipped_lines(column, text, "ERROR" if helps else "INFO", context)
        draw_remedy(column, helps, name)
    known = {text for text, *_ in warnings}
    told = [text for text in status().notes.split("\n") if text and text not in known]
    missed = [text for text in told if "the tolerance of" in text]
    for text in missed[:_GRAVEST]:
        clipped_lines(layout, text, "ERROR", context)
    # What is cut off here as well.
    more = max(len(warnings) - gravest, 0) + len(told)
    if more:
        layout.operator("prt.notes", text=f"{more} More to Know…", icon="INFO")


def draw_remedy(layout, helps, name):
    """The button that helps against a warning, where there is one."""
    if helps:
        button = layout.operator(helps)
        if name is not None:
            button.object_name = name


class PRT_PT_bake(Panel, bpy.types.Panel):
    bl_label = "Bake Settings"
    bl_parent_id = "PRT_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, settings = self.split(), context.scene.prt
        layout.enabled = not status().running
        layout.prop(settings, "resolution")
        layout.prop(settings, "tolerance")
        layout.prop(settings, "all_bounces")
        if not settings.all_bounces:
            layout.prop(settings, "bounces")
        layout.prop(settings, "refine")
        if settings.refine:
            layout.prop(settings, "refine_tolerance")
            layout.prop(settings, "refine_vertices")
        layout.prop(settings, "method")
        layout.prop(settings, "caster")
        layout.prop(settings, "name")
        layout.prop(settings, "folder")


class PRT_PT_objects(Panel, bpy.types.Panel):
    bl_label = "Objects"
    bl_parent_id = "PRT_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.layout.template_list(
            "PRT_UL_objects", "", context.scene, "objects", status(), "active_object", rows=4
        )


class PRT_UL_objects(bpy.types.UIList):
    """Objects that can be baked: who receives, whose backs are lit; the rest only casts."""

    def draw_item(self, _context, layout, _data, item, _icon, _active, _property, _index):
        row = layout.row(align=True)
        row.label(text=item.name_full, icon="OUTLINER_OB_" + _ICONS.get(item.type, "MESH"))
        row.label(text="" if item.prt.receives else "casts only")
        receives = "SHADING_RENDERED" if item.prt.receives else "SHADING_SOLID"
        row.prop(item.prt, "receives", text="", icon=receives)
        row.prop(item.prt, "two_sided", text="", icon="MOD_SOLIDIFY")
        row.prop(item, "hide_render", text="", emboss=False)

    def filter_items(self, _context, data, name):
        objects = getattr(data, name)
        shown = [
            self.bitflag_filter_item
            if (o.type in plan.GEOMETRY or o.instance_type == "COLLECTION")
            and not (is_copy(o) or is_kept(o))
            and self.filter_name.lower() in o.name.lower()
            else 0
            for o in objects
        ]
        return shown, []


_ICONS = {"CURVE": "CURVE", "SURFACE": "SURFACE", "META": "META", "FONT": "FONT", "EMPTY": "EMPTY"}


register, unregister = bpy.utils.register_classes_factory(
    (PRT_UL_objects, PRT_PT_main, PRT_PT_bake, PRT_PT_objects)
)
