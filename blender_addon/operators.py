"""What the buttons do; a script that calls the same operators gets the same."""

from pathlib import Path

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    EnumProperty,
    IntProperty,
    IntVectorProperty,
    StringProperty,
)

from prt_core import PRTError
from prt_core.api import bake_blend_steps
from prt_core.blender import colours
from prt_core.blender.compat import fcurve_of
from prt_core.blender.depsgraph import read_camera
from prt_core.errors import expect
from prt_core.progress import Progress, run

from . import bakes, live, plan, preview, views, work
from .work import LongWork, status

# Simple subdivisions at most: each makes four faces of one.
_MOST_LEVELS = 6


class _Common:
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


class _OfBake(_Common):
    """Needs a bake."""

    @classmethod
    def why_not(cls, context):
        if not context.scene.prt.loaded:
            return "Bake the scene, or load a bake, first"
        return super().why_not(context)


class PRT_OT_bake(LongWork, _Common, bpy.types.Operator):
    """Trace how light travels in the scene, once; a bake that was stopped goes on where it was"""

    bl_idname = "prt.bake"
    bl_label = "Bake"
    title = "Bake"

    restart: BoolProperty(
        name="Restart", description="Begin anew even where the bake is there already",
        options={"SKIP_SAVE"},
    )  # fmt: skip

    def steps(self, context, pace):
        scene = context.scene
        self.scene_name, path = scene.name, plan.output_path(scene)
        caster = scene.prt.caster
        live.stop()
        self.report_line = yield from bake_blend_steps(
            None,
            path,
            plan.bake_settings(scene),
            plan.receivers(scene),
            plan.two_sided(scene),
            self.restart or "changed",
            pace,
            scene,
            strict=False,
        )
        preview.forget()
        there = yield from preview.load_steps(path, caster)
        found = yield from preview.check_steps(self._scene(), there, pace)
        expect(
            not (found.missing or found.changed),
            f"bake: the scene was changed meanwhile ({found}); the bake is kept, bake again",
        )
        asked, radiance = None, None
        try:
            asked = preview.request(self._scene())
            radiance = yield from asked.steps(there, pace)
        except PRTError as error:
            self.report({"WARNING"}, f"{error}; the bake is there, choose another light")
        return there, asked, radiance

    def stopped(self, context):
        bakes.refresh(context.scene)

    def _scene(self):
        scene = bpy.data.scenes.get(self.scene_name)
        expect(scene is not None, f"scene '{self.scene_name}' was removed or renamed meanwhile")
        return scene

    def finish(self, context, result):
        there, asked, radiance = result
        scene = self._scene()
        scene.prt.loaded = preview.relative(there.path)
        if radiance is not None:
            run(live.show_steps(scene.name, there, radiance, asked))
            views.show()
        bakes.refresh(scene)
        line = self.report_line
        seconds = sum(line["seconds"].values())
        text = f"Baked {line['points']:,} points in {seconds:.1f} s with {line['back_end']}"
        if line["error"] is not None:
            text += f", error {line['error']:.2%}"
        self.report({"INFO"}, text)
        work.say(text)


class PRT_OT_cancel(bpy.types.Operator):
    """Stop; what is done is kept, and the same button goes on from there"""

    bl_idname = "prt.cancel"
    bl_label = "Cancel"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, _context):
        cls.poll_message_set("Nothing is under way")
        return status().running

    def execute(self, _context):
        status().cancel = True
        return {"FINISHED"}


class PRT_OT_relight(LongWork, _OfBake, bpy.types.Operator):
    """Colours of the loaded bake under the light of the panel, with all shadow rays"""

    bl_idname = "prt.relight"
    bl_label = "Relight"
    title = "Relight"

    def steps(self, context, pace):
        scene = context.scene
        self.scene_name = scene.name
        live.stop()
        there = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
        asked = preview.request(bpy.data.scenes[self.scene_name])
        radiance = yield from asked.steps(there, pace)
        return there, asked, radiance

    def finish(self, context, result):
        there, asked, radiance = result
        run(live.show_steps(self.scene_name, there, radiance, asked))
        work.say(f"{len(radiance):,} points relit")


class PRT_OT_load(LongWork, _Common, bpy.types.Operator):
    """Load a bake and show its colours"""

    bl_idname = "prt.load"
    bl_label = "Load"
    title = "Load"

    filepath: StringProperty(name="Bake", description="NAME.prt", subtype="DIR_PATH")

    def steps(self, context, pace):
        scene = context.scene
        self.scene_name = scene.name
        path = Path(bpy.path.abspath(self.filepath)) if self.filepath else plan.output_path(scene)
        live.stop()
        there = yield from preview.load_steps(path, scene.prt.caster)
        scene = bpy.data.scenes[self.scene_name]
        found = yield from preview.check_steps(scene, there, pace)
        if not found.fresh:
            text = f"{path.name}: the scene is not the one that was baked ({found})"
            self.report({"WARNING"}, text)
        asked = preview.request(bpy.data.scenes[self.scene_name])
        radiance = yield from asked.steps(there, pace)
        return there, asked, radiance

    def finish(self, context, result):
        there, asked, radiance = result
        scene = bpy.data.scenes[self.scene_name]
        run(live.show_steps(self.scene_name, there, radiance, asked))
        scene.prt.loaded = preview.relative(there.path)
        views.show()
        work.say(f"{Path(there.path).name} loaded")


class PRT_OT_clear(_Common, bpy.types.Operator):
    """Take the preview off: materials, active colours and views come back; bakes stay on disk"""

    bl_idname = "prt.clear"
    bl_label = "Restore"

    def execute(self, context):
        live.stop()
        changed = preview.clear(context.scene)
        context.scene.prt.loaded = ""
        preview.forget()
        views.restore()
        work.say(f"{changed} objects are as they were")
        return {"FINISHED"}


class PRT_OT_remove(_Common, bpy.types.Operator):
    """Delete a bake from the disk"""

    bl_idname = "prt.remove"
    bl_label = "Delete Bake"
    bl_options = {"REGISTER", "INTERNAL"}
    object_mode = False

    filepath: StringProperty(name="Bake", subtype="DIR_PATH")

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def execute(self, context):
        try:
            bakes.remove(bpy.path.abspath(self.filepath))
        except work.FAILURES as error:
            return self.fail(error)
        bakes.refresh(context.scene)
        work.say(f"{Path(self.filepath).name} deleted")
        return {"FINISHED"}


class PRT_OT_refresh(_Common, bpy.types.Operator):
    """Look at the scene and the folder again: points, seconds, memory, warnings, bakes"""

    bl_idname = "prt.refresh"
    bl_label = "Check"
    bl_options = {"REGISTER"}
    object_mode = False

    def execute(self, context):
        scene = context.scene
        bakes.refresh(scene)
        rate = bakes.rate(plan.back_end(scene))
        try:
            made = run(plan.steps(scene, rays_per_second=rate))
        except work.FAILURES as error:
            return self.fail(error)
        cost = made.cost
        self.report(
            {"INFO"},
            f"{cost.points:,} points, {cost.rays / 1e6:.1f} M rays, about {cost.seconds:.0f} s "
            f"with {made.back_end}, {cost.memory_bytes / 1e6:.0f} MB",
        )
        return {"FINISHED"}


class PRT_OT_keep(LongWork, _OfBake, bpy.types.Operator):
    """Keep the colours as an attribute of the meshes that stays when the preview goes"""

    bl_idname = "prt.keep"
    bl_label = "Keep Colours"
    title = "Keep Colours"

    attribute: StringProperty(name="Attribute", default="Relit")
    domain: EnumProperty(
        name="Domain", items=[("CORNER", "Face Corner", ""), ("POINT", "Vertex", "")]
    )
    kind: EnumProperty(
        name="Type",
        items=[
            ("FLOAT_COLOR", "Color", "32 bits a channel, linear; nothing is lost"),
            ("BYTE_COLOR", "Byte Color", "8 bits a channel, sRGB, cut to 0 to 1"),
        ],
    )
    channels: EnumProperty(
        name="Channels",
        items=[(name, name, f"Write {name} only, leave the others") for name in "RGB"],
        options={"ENUM_FLAG"},
        default={"R", "G", "B"},
    )

    def steps(self, context, pace):
        scene = context.scene
        self.scene_name = scene.name
        there = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
        radiance = yield from preview.request(bpy.data.scenes[self.scene_name]).steps(there, pace)
        yield from preview.check_steps(bpy.data.scenes[self.scene_name], there, pace)
        return there, radiance

    def finish(self, context, result):
        there, radiance = result
        scene = bpy.data.scenes[self.scene_name]
        expect(
            self.attribute != scene.prt.attribute,
            f"attribute: '{self.attribute}' is the preview's and goes with it; use another name",
        )
        found = there.bake.colours(radiance)
        copies = colours.write_all(
            there.bake.scene,
            found,
            self.attribute,
            self.domain,
            renamed=there.renamed,
            target=scene,
            byte=self.kind == "BYTE_COLOR",
            channels="".join(sorted(self.channels, key="RGB".index)),
            active=False,
        )
        text = f"'{self.attribute}' kept on {len(found)} objects"
        if copies:
            text += f", {len(copies)} of them copies in the collection '{colours.COLLECTION}'"
        self.report({"INFO"}, text)
        work.say(text)


class PRT_OT_export(LongWork, _OfBake, bpy.types.Operator):
    """Write the colours of a range of frames, one .npz (and picture, where wanted) a frame"""

    bl_idname = "prt.export"
    bl_label = "Export Sequence"
    bl_options = {"REGISTER"}
    title = "Export"
    object_mode = False

    filepath: StringProperty(
        name="File", description="#### is the number of the frame", default="//prt/relit_####.npz",
        subtype="FILE_PATH",
    )  # fmt: skip
    use_scene_range: BoolProperty(name="Scene Range", default=True)
    first: IntProperty(name="First", default=1)
    last: IntProperty(name="Last", default=1)
    pictures: BoolProperty(
        name="Pictures", description="A .png from the scene's camera beside each file"
    )
    size: IntVectorProperty(name="Size", size=2, default=(960, 540), min=16, max=8192)

    def invoke(self, context, event):
        if bpy.app.background:
            return self.execute(context)
        return context.window_manager.invoke_props_dialog(self)

    def steps(self, context, pace):
        from prt_core.evaluate.sequence import PictureWriter, frame_path, write_npz

        scene = context.scene
        frames = range(self.first, self.last + 1)
        if self.use_scene_range:
            frames = range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
        expect(len(frames), f"frames: {self.first} to {self.last} holds none")
        expect(
            bpy.data.filepath or not self.filepath.startswith("//"),
            "file: save the scene first, or give a full path",
        )
        pattern = bpy.path.abspath(self.filepath)
        there = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
        self.scene_name, before = scene.name, scene.frame_current
        pictures = PictureWriter(there.bake, tuple(self.size), scene.prt.caster)
        try:
            for count, frame in enumerate(frames):
                scene = bpy.data.scenes[self.scene_name]
                scene.frame_set(frame)
                asked = preview.request(scene)
                radiance = yield from asked.steps(there, pace)
                path = frame_path(pattern, frame)
                write_npz(path, there.bake.colours(radiance))
                if self.pictures:
                    camera = read_camera(bpy.data.scenes[self.scene_name])
                    pictures.write(path.with_suffix(".png"), radiance, camera)
                yield Progress("frames", count + 1, len(frames))
        finally:
            bpy.data.scenes[self.scene_name].frame_set(before)
        return frame_path(pattern, frames[0]), len(frames)

    def finish(self, context, result):
        text = f"{result[1]} frames written, the first is {result[0]}"
        self.report({"INFO"}, text)
        work.say(text)


class PRT_OT_turntable(_Common, bpy.types.Operator):
    """Keyframe one turn of the light over the scene's frames"""

    bl_idname = "prt.turntable"
    bl_label = "Keyframe a Turn"
    object_mode = False

    def execute(self, context):
        scene = context.scene
        start = scene.prt.rotation
        # The frame after the last is the first again: a loop without a stop.
        ends = ((scene.frame_start, start), (scene.frame_end + 1, start + 2 * np.pi))
        for frame, angle in ends:
            scene.prt.rotation = angle
            scene.prt.keyframe_insert("rotation", frame=frame)
        for key in fcurve_of(scene, "prt.rotation").keyframe_points:
            key.interpolation = "LINEAR"
        scene.prt.rotation = start
        work.say(f"One turn from frame {scene.frame_start} to {scene.frame_end}")
        return {"FINISHED"}


class PRT_OT_subdivide(_Common, bpy.types.Operator):
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

    def execute(self, context):
        scene = context.scene
        made, _ = plan.of(scene)
        if made is None or made.cost is None:
            try:
                made = run(plan.steps(scene))
            except work.FAILURES as error:
                return self.fail(error)
        done = 0
        for name in [self.object_name] if self.object_name else list(made.cost.coarse):
            item, found = scene.objects.get(name), made.cost.coarse.get(name)
            if item is None or item.type != "MESH" or found is None:
                self.report({"WARNING"}, f"{name}: no mesh of this scene that is too coarse")
                continue
            try:
                levels = _subdivide(context, item, min(found[1], _MOST_LEVELS), self.apply)
            except work.FAILURES as error:
                return self.fail(error)
            done += 1
            work.say(f"{name}: every edge halved {levels} times")
        live.geometry_changed(scene)
        return {"FINISHED"} if done else {"CANCELLED"}


def _subdivide(context, item, levels, apply):
    """A Simple subdivision at the start of the object's modifiers, or in its mesh."""
    modifier = item.modifiers.new("PRT Subdivision", "SUBSURF")
    modifier.subdivision_type = "SIMPLE"
    modifier.levels = modifier.render_levels = levels
    item.modifiers.move(len(item.modifiers) - 1, 0)
    if apply:
        try:
            with context.temp_override(object=item, active_object=item, selected_objects=[item]):
                bpy.ops.object.modifier_apply(modifier=modifier.name)
        except RuntimeError as error:
            item.modifiers.remove(modifier)
            reason = " ".join(str(error).removeprefix("Error: ").split())
            raise PRTError(f"{item.name}: {reason} Try it as a modifier instead") from error
    return levels


class PRT_OT_unhide(_Common, bpy.types.Operator):
    """Let an object render, so that it is baked"""

    bl_idname = "prt.unhide"
    bl_label = "Show in Renders"
    object_mode = False

    object_name: StringProperty(name="Object")

    def execute(self, context):
        item = context.scene.objects.get(self.object_name)
        if item is None:
            return self.fail(f"{self.object_name}: no such object in this scene")
        item.hide_render = False
        return {"FINISHED"}


class PRT_OT_shading(_Common, bpy.types.Operator):
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


_CLASSES = (
    PRT_OT_bake,
    PRT_OT_cancel,
    PRT_OT_relight,
    PRT_OT_load,
    PRT_OT_clear,
    PRT_OT_remove,
    PRT_OT_refresh,
    PRT_OT_keep,
    PRT_OT_export,
    PRT_OT_turntable,
    PRT_OT_subdivide,
    PRT_OT_unhide,
    PRT_OT_shading,
)
register, unregister = bpy.utils.register_classes_factory(_CLASSES)
