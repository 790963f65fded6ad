"""One click against what the panel warns of."""

import bpy
from bpy.props import BoolProperty, StringProperty

from prt_core import PRTError, run
from prt_core.blender.identity import find_object
from prt_core.runtime.stillness import others_still

from . import live, plan, work
from .buttons import Button

# Simple subdivisions at most: each makes four faces of one.
_MOST_LEVELS = 6


class PRT_OT_subdivide(Button, bpy.types.Operator):
    """Give objects with too few vertices for shadows a Simple subdivision"""

    bl_idname = "prt.subdivide"
    bl_label = "Subdivide"

    object_name: StringProperty(name="Object", description="Empty: all that need it")
    apply: BoolProperty(
        name="Into the Mesh",
        description="Subdivide the mesh itself, so that it keeps the colours; otherwise a "
        "modifier, and the colours go to a copy",
        default=True,
    )

    def invoke(self, context, _event):
        if not work.has_window(context):
            return self.execute(context)
        return context.window_manager.invoke_props_dialog(self, confirm_text="Subdivide")

    def draw(self, _context):
        self.layout.label(text=self.object_name or "All objects that need it")
        self.layout.prop(self, "apply")

    def execute(self, context):
        scene = context.scene
        planned, _ = plan.of(scene)
        if planned is None or planned.cost is None:
            try:
                planned = run(plan.steps(scene))
            except work.FAILURES as error:
                return self.fail(error)
        done = 0
        for name in [self.object_name] if self.object_name else list(planned.cost.coarse):
            item, own = _own(scene, name), planned.cost.coarse.get(name)
            if item is None or item.type != "MESH" or own is None:
                self.report({"WARNING"}, f"{name}: no mesh of this scene that is too coarse")
                continue
            try:
                levels = _subdivide(context, item, min(own[1], _MOST_LEVELS), self.apply)
            except work.FAILURES as error:
                return self.fail(error)
            done += 1
            work.say(f"{name}: every edge halved {levels} times")
        live.geometry_changed(scene)
        return {"FINISHED"} if done else {"CANCELLED"}


def _own(scene, name):
    """The file's own object of that name, where it is in the scene."""
    item = find_object(name)
    return item if item in list(scene.objects) else None


def _subdivide(context, item, levels, apply):
    """A Simple subdivision at the start of the object's modifiers, or in its mesh."""
    modifier = item.modifiers.new("PRT Subdivision", "SUBSURF")
    modifier.subdivision_type = "SIMPLE"
    modifier.levels = modifier.render_levels = levels
    item.modifiers.move(len(item.modifiers) - 1, 0)
    if apply:
        try:
            here = {"object": item, "active_object": item, "selected_objects": [item]}
            with others_still(), context.temp_override(**here):
                bpy.ops.object.modifier_apply(modifier=modifier.name)
        except RuntimeError as error:
            item.modifiers.remove(modifier)
            reason = " ".join(str(error).removeprefix("Error: ").split())
            raise PRTError(f"{item.name}: {reason} Try it as a modifier instead") from error
    return levels


class PRT_OT_unhide(Button, bpy.types.Operator):
    """Let an object render, so that it is baked"""

    bl_idname = "prt.unhide"
    bl_label = "Show in Renders"
    object_mode = False

    object_name: StringProperty(name="Object")

    def execute(self, context):
        item = _own(context.scene, self.object_name)
        if item is None:
            return self.fail(f"{self.object_name}: no such object in this scene")
        item.hide_render = False
        return {"FINISHED"}


class PRT_OT_use_gloss(Button, bpy.types.Operator):
    """Bake what metal and glossy surfaces reflect as well"""

    bl_idname = "prt.use_gloss"
    bl_label = "Bake with Gloss"
    object_mode = False

    def execute(self, context):
        context.scene.prt.gloss = True
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory(
    (PRT_OT_subdivide, PRT_OT_unhide, PRT_OT_use_gloss)
)
