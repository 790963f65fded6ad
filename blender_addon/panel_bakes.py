"""The panel's section Bakes: those of the folder."""

import bpy

from . import bakes, preview
from .panel_parts import Panel, lines, seconds
from .work import status


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
        row.template_list("PRT_UL_bakes", "", state, "bakes", state, "active_bake", rows=2)
        side = row.column(align=True)
        if not 0 <= state.active_bake < len(state.bakes):
            side.operator("prt.refresh", text="", icon="FILE_REFRESH")
            layout.label(text="No bakes in the folder")
            return
        item = state.bakes[state.active_bake]
        draw_buttons(side, scene, item)
        draw_about(layout, context, item)


def draw_buttons(side, scene, item):
    """What can be done with a bake."""
    if item.complete:
        side.operator("prt.load", text="", icon="IMPORT").filepath = item.path
        if preview.path_of(scene) == item.path:
            side.operator("prt.compress", text="", icon="FILE_ARCHIVE")
    side.operator("prt.remove", text="", icon="TRASH").filepath = item.path


def draw_about(layout, context, item):
    """What a bake is like: whether it is of the scene, and how near the truth."""
    text, icon = bakes.state(context.scene, item)
    row = layout.row()
    lines(row, text, icon, context)
    if item.complete and item.notes:
        count = len(item.notes.split("\n"))
        text = f"{count} {'Note' if count == 1 else 'Notes'}…"
        row.operator("prt.notes", text=text, icon="INFO").of_bake = True
    if item.origin:
        lines(layout, f"of another: {item.origin}", "INFO", context)
    if not item.complete:
        return
    text = f"{item.points:,} points, {seconds(item.seconds)}"
    lines(layout, f"{text}; {accuracy(item)}" if accuracy(item) else text, "BLANK1", context)
    if item.compressed:
        row = layout.row()
        lines(row, f"compressed: {item.compressed}", "BLANK1", context)
        if preview.path_of(context.scene) == item.path:
            button = row.operator("prt.compress", text="", icon="X")
            button.method, button.confirmed = "none", True


def accuracy(item):
    """How far the colours of a bake may be off, and of what; "" where nothing is."""
    parts = []
    if item.method != "exhaustive":
        parts.append(f"direct light within {item.visibility_error:.2%}")
    if item.error >= 0:
        parts.append(f"bounced light within {item.error:.2%}")
    if item.error_enclosed >= 0:
        parts.append(f"in enclosed places within {item.error_enclosed:.1%} of the light there")
    return ", ".join(parts)


class PRT_UL_bakes(bpy.types.UIList):
    """The bakes of the folder; the one that is shown has an eye."""

    def draw_item(self, context, layout, _data, item, _icon, _active, _property, _index):
        scene = context.scene
        row = layout.row(align=True)
        shown = preview.path_of(scene) == item.path
        row.label(text=item.name, icon="HIDE_OFF" if shown else bakes.state(scene, item)[1])
        row.label(text=f"{item.megabytes:.1f} MB")


register, unregister = bpy.utils.register_classes_factory((PRT_UL_bakes, PRT_PT_bakes))
