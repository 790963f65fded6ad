"""The panel in the 3D view's sidebar. Drawing only reads."""

from pathlib import Path

import bpy

from prt_core.blender.stand_ins import is_copy, is_kept

from . import bakes, plan, preview, views
from .work import status

_MOST_WARNINGS = 8


class Panel:
    """Where the panels are."""

    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "PRT"

    def split(self):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout


class PRT_PT_main(Panel, bpy.types.Panel):
    bl_idname = "PRT_PT_main"
    bl_label = "PRT Relight"

    def draw(self, context):
        layout, state, scene = self.layout, status(), context.scene
        column = layout.column()
        column.scale_y = 1.4
        if state.running:
            label = f"{state.title}: {state.stage}"
            column.progress(factor=state.done, text=label)
            column.operator("prt.cancel", icon="CANCEL")
        else:
            text = "Go On Baking" if bakes.goes_on(scene) else "Bake"
            column.operator("prt.bake", text=text, icon="RENDER_STILL")
        if state.message:
            icon = "ERROR" if state.failed else "INFO"
            lines(layout, state.message, icon, context)
            notes(layout, state.notes, context)
        held = preview.held(scene)
        if held is not None and held.warned:
            lines(layout, held.warned, "ERROR", context)
        row = layout.row(align=True)
        if scene.prt.loaded:
            row.operator("prt.relight", icon="LIGHT_SUN")
        if preview.present(scene):
            row.operator("prt.clear", icon="LOOP_BACK")


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


class PRT_PT_bake(Panel, bpy.types.Panel):
    bl_label = "Bake Settings"
    bl_parent_id = "PRT_PT_main"

    def draw(self, context):
        layout, scene = self.split(), context.scene
        settings = scene.prt
        column = layout.column()
        column.enabled = not status().running
        column.prop(settings, "resolution")
        column.prop(settings, "tolerance")
        column.prop(settings, "all_bounces")
        if not settings.all_bounces:
            column.prop(settings, "bounces")
        column.prop(settings, "gloss")
        column.prop(settings, "method")
        column.prop(settings, "caster")
        column.prop(settings, "name")
        column.prop(settings, "folder")
        plan.want(scene)
        self._plan(context, layout)

    def _plan(self, context, layout):
        scene = context.scene
        planned, holds = plan.of(scene)
        row = layout.row()
        row.use_property_split = False
        if planned is None or planned.cost is None:
            row.label(text="Not checked yet" if planned is None else "Nothing to bake")
        else:
            cost = planned.cost
            text = f"{cost.points:,} points, {cost.rays / 1e6:.0f} M rays"
            row.label(text=text if holds else text + " (before the last change)")
            details = layout.column(align=True)
            details.scale_y = 0.8
            details.label(text=f"about {_seconds(cost.seconds)} with {planned.back_end}")
            details.label(
                text=f"{_megabytes(cost.memory_bytes)} memory, {_megabytes(cost.disk_bytes)} disk"
            )
        row.operator("prt.refresh", text="", icon="FILE_REFRESH")
        warnings = plan.warnings(scene)
        for text, helps, name in warnings[:_MOST_WARNINGS]:
            box = layout.column(align=True)
            lines(box, text, "ERROR" if helps else "INFO", context)
            if helps:
                button = box.operator(helps)
                if name is not None:
                    button.object_name = name
        if len(warnings) > _MOST_WARNINGS:
            layout.label(text=f"and {len(warnings) - _MOST_WARNINGS} more")


class PRT_PT_light(Panel, bpy.types.Panel):
    bl_label = "Light"
    bl_parent_id = "PRT_PT_main"

    def draw(self, context):
        layout, settings = self.split(), context.scene.prt
        layout.row().prop(settings, "light", expand=True)
        if settings.light == "FILE":
            layout.prop(settings, "file")
        elif settings.light == "STUDIO":
            row = layout.row()
            row.use_property_split = False
            row.template_icon_view(settings, "studio", show_labels=True, scale=5)
            layout.label(text=Path(settings.studio).stem.replace("_", " ").title())
        column = layout.column(align=True)
        column.use_property_decorate = True
        column.prop(settings, "rotation")
        column.prop(settings, "strength")
        column.prop(settings, "exposure")
        layout.prop(settings, "sharp_sun")
        layout.prop(settings, "use_lamps")
        if settings.use_lamps or settings.sharp_sun:
            layout.prop(settings, "lamp_samples")
        draw_gloss(layout, context)


def draw_gloss(layout, context):
    """The switch of gloss, grey with the reason where there is none, and from where it is seen."""
    settings, missing = context.scene.prt, preview.no_gloss(preview.held(context.scene))
    column = layout.column()
    column.enabled = not missing
    column.prop(settings, "show_gloss")
    if missing:
        lines(layout, missing, "INFO", context)
    elif settings.show_gloss:
        column.row().prop(settings, "seen_from", expand=True)
        if settings.seen_from == "CAMERA":
            column.prop(settings, "seen_by")


class PRT_PT_emission(Panel, bpy.types.Panel):
    bl_label = "Emission"
    bl_parent_id = "PRT_PT_light"

    @classmethod
    def poll(cls, context):
        return bool(preview.emitters(preview.held(context.scene)))

    def draw(self, context):
        settings = context.scene.prt
        column = self.layout.column(align=True)
        for name in preview.emitters(preview.held(context.scene)):
            item = settings.emitters.get(name)
            if item is None:
                continue
            row = column.row(align=True)
            row.label(text=name, icon="LIGHT")
            row.prop(item, "recolour", text="", icon="COLOR")
            if item.recolour:
                row.prop(item, "colour", text="")
            row.prop(item, "strength", text="")


class PRT_PT_preview(Panel, bpy.types.Panel):
    bl_label = "Preview"
    bl_parent_id = "PRT_PT_main"

    def draw(self, context):
        layout, settings = self.split(), context.scene.prt
        layout.prop(settings, "live")
        layout.prop(settings, "attribute")
        layout.prop(settings, "domain")
        layout.prop(settings, "material")
        layout.prop(settings, "use_compressed")
        row = layout.row(align=True)
        row.prop(settings, "compress_tolerance")
        row.operator("prt.compress", icon="FILE_ARCHIVE")
        layout.operator("prt.shading", icon="SHADING_SOLID", depress=views.shown())
        layout.separator()
        column = layout.column(align=True)
        keep = column.operator("prt.keep", icon="COLOR")
        keep.domain = settings.domain
        column.operator("prt.turntable", icon="KEY_HLT")
        column.operator("prt.export", icon="EXPORT")
        column.operator("prt.export_glb", icon="EXPORT")
        column.operator("prt.web_page_dialog", icon="URL")
        column.operator("prt.lightmap", icon="UV")
        column.operator("prt.occlusion", icon="SHADING_RENDERED")


class PRT_PT_bakes(Panel, bpy.types.Panel):
    bl_label = "Bakes"
    bl_parent_id = "PRT_PT_main"

    def draw(self, context):
        layout, state, scene = self.layout, status(), context.scene
        row = layout.row()
        if not bakes.listed(scene):
            row.label(text="Not looked at yet")
            row.operator("prt.refresh", text="", icon="FILE_REFRESH")
            return
        row.template_list("PRT_UL_bakes", "", state, "bakes", state, "active_bake", rows=3)
        side = row.column(align=True)
        side.operator("prt.refresh", text="", icon="FILE_REFRESH")
        if not 0 <= state.active_bake < len(state.bakes):
            layout.label(text="No bakes in the folder")
            return
        item = state.bakes[state.active_bake]
        side.operator("prt.remove", text="", icon="TRASH").filepath = item.path
        row = layout.row()
        row.enabled = item.complete
        row.operator("prt.load", icon="IMPORT").filepath = item.path
        text, icon = bakes.state(scene, item)
        lines(layout, text, icon, context)
        if item.origin:
            lines(layout, f"of another: {item.origin}", "INFO", context)
        if item.complete:
            if item.method != "exhaustive":
                text = f"{item.entries:.1f} % traced by {item.method}, "
                text += f"error at most {item.visibility_error:.2%}"
                lines(layout, text, "BLANK1", context)
            if item.compressed:
                row = layout.row()
                lines(row, f"compressed: {item.compressed}", "BLANK1", context)
                if preview.path_of(scene) == item.path:
                    row.operator("prt.compress", text="", icon="X").method = "none"
            error = "" if item.error < 0 else f", bounces {item.error:.2%}"
            text = f"{item.points:,} points, {item.megabytes:.1f} MB, "
            text += f"{_seconds(item.seconds)} with {item.back_end}{error}"
            lines(layout, text, "BLANK1", context)
            notes(layout, item.notes, context)


class PRT_UL_bakes(bpy.types.UIList):
    """The bakes of the folder; the one that is shown has an eye."""

    def draw_item(self, context, layout, _data, item, _icon, _active, _property, _index):
        scene = context.scene
        row = layout.row(align=True)
        shown = preview.path_of(scene) == item.path
        row.label(text=item.name, icon="HIDE_OFF" if shown else bakes.state(scene, item)[1])
        row.label(text=f"{item.megabytes:.1f} MB")


def notes(layout, text, context):
    """What a bake has to say of itself, a line each."""
    texts = text.split("\n") if text else []
    for each in texts[:_MOST_WARNINGS]:
        lines(layout, each, "DOT", context)
    if len(texts) > _MOST_WARNINGS:
        layout.label(text=f"and {len(texts) - _MOST_WARNINGS} more")


def _seconds(value):
    return f"{value:.0f} s" if value < 120 else f"{value / 60:.0f} min"


def _megabytes(value):
    return f"{value / 1e6:.0f} MB" if value < 2e9 else f"{value / 1e9:.1f} GB"


def lines(layout, text, icon, context):
    """Text of any length, cut between words to the panel's width."""
    width = max(20, int(context.region.width / (7 * context.preferences.system.ui_scale)) - 4)
    parts, line = [], ""
    for word in text.split():
        if line and len(line) + len(word) >= width:
            parts.append(line)
            line = ""
        line = f"{line} {word}".strip()
    column = layout.column(align=True)
    column.scale_y = 0.8
    for index, part in enumerate([*parts, line]):
        column.label(text=part, icon="BLANK1" if index else icon)


_CLASSES = (
    PRT_UL_objects,
    PRT_UL_bakes,
    PRT_PT_main,
    PRT_PT_objects,
    PRT_PT_bake,
    PRT_PT_light,
    PRT_PT_emission,
    PRT_PT_preview,
    PRT_PT_bakes,
)
register, unregister = bpy.utils.register_classes_factory(_CLASSES)
