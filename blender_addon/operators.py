"""What the buttons do; a script that calls the same operators gets the same."""

import time
from pathlib import Path

import bpy
from bpy.props import (
    BoolProperty,
    StringProperty,
)

from prt_core import PRTError
from prt_core.api import bake_blend_steps, compress_bake_steps
from prt_core.bake.first_look import first_look_steps
from prt_core.bake.report_lines import missed
from prt_core.blender.compat import PATH_OPTIONS
from prt_core.blender.identity import by_uid
from prt_core.blender.realised import KEPT_COLLECTION
from prt_core.errors import expect
from prt_core.runtime.progress import Progress, run
from prt_core.store import remove_bake

from . import (
    bakes,
    field_list,
    freshness,
    live,
    plan,
    preview,
    refining,
    saving,
    showing,
    views,
    work,
)
from .buttons import Asks, BakeButton, Button
from .request import request
from .work import LongWork, status

# Seconds of a step of the first look. Blender draws the 3D view after each whose rays it casts
# itself, which takes longer than a step of other work.
_FIRST_PACE = 0.1


class Baking(LongWork, Button):
    """What the buttons that bake have in common."""

    title = "Bake"
    when_stopped = "colours are as before, and the same button goes on where it was"
    # Whether what is there is begun anew, or only what has changed of it baked, of some objects.
    restart, update, only = False, False, None

    def steps(self, context, pace):
        scene = self.begin(context)
        self.path = path = plan.output_path(scene)
        caster = scene.prt.caster
        if not self.restart:
            bakes.expect_ours(scene, path)
        live.stop()
        # What is taken over needs no first look: it stays as it is shown.
        pictures = None if pace is None or self.update else showing.begin(scene)
        finished = False
        try:
            result = yield from self._bake_steps(path, caster, pace, pictures)
            finished = True
            return result
        finally:
            showing.end(finished)
            scene = by_uid(bpy.data.scenes, self._uid)
            if pictures is not None and not finished and scene is not None:
                live.touch(scene, show=True)

    def _bake_steps(self, path, caster, pace, pictures):
        settings = plan.bake_settings(self.scene)
        refined = refining.refine_settings(self.scene)
        built, digests = plan.built(self.scene)
        # What is refined first shows itself on its own finer meshes.
        if pictures is not None and built is not None and refined is None:
            # The panel knows the scene, which is read once more after this.
            yield from first_look_steps(built, settings, pictures, _FIRST_PACE, digests)
            while showing.awaits_first():
                time.sleep(0.01)
                yield Progress("first look", 0, 0)
        scene = self.scene
        self.report_line = yield from bake_blend_steps(
            None,
            path,
            settings,
            plan.receivers(scene),
            plan.two_sided(scene),
            False if self.update else self.restart or "changed",
            pace,
            scene,
            strict=False,
            pictures=pictures,
            refine=refined,
            update=self.update,
            only=self.only,
        )
        preview.forget()
        path = saving.settle(self.scene, path)
        held = yield from preview.load_steps(path, caster)
        differences = yield from freshness.check_steps(self.scene, held, pace)
        expect(
            not (differences.missing or differences.changed),
            f"bake: the scene was changed meanwhile ({differences}); the bake is kept, bake again",
        )
        asked, radiance = None, None
        try:
            asked = request(self.scene)
            radiance = yield from asked.steps(held, pace)
        except PRTError as error:
            self.report({"WARNING"}, f"{error}; the bake is there, choose another light")
        return held, asked, radiance

    def stopped(self, context):
        saving.settle(self.scene, self.path)
        bakes.refresh(context.scene)

    def finish(self, context, result):
        held, asked, radiance = result
        scene = self.scene
        scene.prt.loaded = preview.relative(held.path)
        if radiance is not None:
            run(live.show_steps(scene.session_uid, held, radiance, asked))
            views.show()
        live.note_preview()
        bakes.refresh(scene, select=held.path)
        line = self.report_line
        seconds = sum(line["seconds"].values())
        text = f"Baked {line['points']:,} points in {seconds:.1f} s with {line['back_end']}"
        if line["error"] is not None:
            text += f", bounced light within {line['error']:.2%}"
            if "error_enclosed" in line:
                text += f", {line['error_enclosed']:.1%} in enclosed places"
        if "reused" in line:
            text = f"{line['reused']['line']}; {seconds:.1f} s"
        for message in line["messages"]:
            self.report({"WARNING"}, message)
        self.report({"INFO"}, text)
        work.say(text, notes=line["messages"])


class PRT_OT_bake(Baking, bpy.types.Operator):
    """Trace how light travels in the scene, once; a bake that was stopped goes on where it was"""

    bl_idname = "prt.bake"
    bl_label = "Bake"

    restart: BoolProperty(
        name="Restart", description="Begin anew even where the bake is there already",
        options={"SKIP_SAVE"},
    )  # fmt: skip


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


class PRT_OT_relight(LongWork, BakeButton, bpy.types.Operator):
    """Colours of the loaded bake under the light of the panel, with all shadow rays"""

    bl_idname = "prt.relight"
    bl_label = "Relight"
    title = "Relight"

    def steps(self, context, pace):
        scene = self.begin(context)
        live.stop()
        held = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
        yield from freshness.warn_steps(self, self.scene, held, pace)
        asked = request(self.scene)
        radiance = yield from asked.steps(held, pace)
        return held, asked, radiance

    def finish(self, context, result):
        held, asked, radiance = result
        run(live.show_steps(self.scene.session_uid, held, radiance, asked))
        live.note_preview()
        work.say(f"{len(radiance):,} points relit")


class PRT_OT_compress(Asks, LongWork, BakeButton, bpy.types.Operator):
    """Compress the loaded bake, so that colours follow the light in milliseconds"""

    bl_idname = "prt.compress"
    bl_label = "Compress"
    title = "Compress"

    call, asked = "compress", ("method",)

    method: StringProperty(
        name="Method", default="auto",
        description="auto tries all on a sample of the points; none removes the compressed form",
    )  # fmt: skip

    def draw(self, context):
        super().draw(context)
        self.layout.prop(context.scene.prt, "compress_tolerance")

    def steps(self, context, pace):
        scene = self.begin(context)
        path = preview.path_of(scene)
        tolerance = None if self.method == "none" else scene.prt.compress_tolerance
        live.stop()
        held = yield from preview.load_steps(path, scene.prt.caster)
        yield from freshness.warn_steps(self, self.scene, held, pace)
        subject = path if self.method == "none" else held.bake
        # The preview shows points, of which a form of the image says nothing.
        self.form_report = yield from compress_bake_steps(
            subject, self.method, tolerance, of="points"
        )
        held.blend.close()
        asked = request(self.scene)
        radiance = yield from asked.steps(held, pace)
        return held, asked, radiance

    def finish(self, context, result):
        held, asked, radiance = result
        run(live.show_steps(self.scene.session_uid, held, radiance, asked))
        bakes.refresh(self.scene)
        if self.form_report is None:
            work.say("The compressed form is gone")
            return
        report = self.form_report
        text = (
            f"Compressed by {report['method']} to {report['bytes'] / 1e6:.1f} MB, "
            f"{report['milliseconds']:.1f} ms a light, error {report['error']:.2%}"
        )
        notes = list(missed(report))
        for note in notes:
            self.report({"WARNING"}, note)
        self.report({"INFO"}, text)
        work.say(text, notes=notes)


class PRT_OT_load(LongWork, Button, bpy.types.Operator):
    """Load a bake and show its colours"""

    bl_idname = "prt.load"
    bl_label = "Load"
    title = "Load"

    filepath: StringProperty(
        name="Bake", description="NAME.prt", subtype="DIR_PATH", options=PATH_OPTIONS
    )

    def steps(self, context, pace):
        scene = self.begin(context)
        path = Path(bpy.path.abspath(self.filepath)) if self.filepath else plan.output_path(scene)
        live.stop()
        held = yield from preview.load_steps(path, scene.prt.caster)
        yield from freshness.warn_steps(self, self.scene, held, pace)
        asked = request(self.scene)
        radiance = yield from asked.steps(held, pace)
        return held, asked, radiance

    def finish(self, context, result):
        held, asked, radiance = result
        scene = self.scene
        run(live.show_steps(scene.session_uid, held, radiance, asked))
        scene.prt.loaded = preview.relative(held.path)
        freshness.note(scene)
        live.note_preview()
        views.show()
        bakes.refresh(scene, select=held.path)
        work.say(f"{Path(held.path).name} loaded", notes=held.bake.report.get("messages") or ())


class PRT_OT_clear(Button, bpy.types.Operator):
    """Take the preview off: materials, active colours and views come back; bakes stay on disk"""

    bl_idname = "prt.clear"
    bl_label = "Restore"

    def execute(self, context):
        live.stop()
        changed = preview.clear(context.scene)
        context.scene.prt.loaded = ""
        preview.forget()
        live.note_preview()
        if not context.scene.prt.field.loaded:
            views.restore()
        text = f"{changed} {'object is' if changed == 1 else 'objects are'} as before"
        behind = preview.behind_kept(context.scene)
        if behind:
            text += f"; {behind} stay hidden behind what was kept of them ('{KEPT_COLLECTION}')"
        work.say(text)
        return {"FINISHED"}


class PRT_OT_remove(Button, bpy.types.Operator):
    """Delete a bake or a light field from the disk"""

    bl_idname = "prt.remove"
    bl_label = "Delete"
    bl_options = {"REGISTER", "INTERNAL"}
    object_mode = False

    filepath: StringProperty(name="Bake", subtype="DIR_PATH", options=PATH_OPTIONS)

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def execute(self, context):
        try:
            remove_bake(bpy.path.abspath(self.filepath))
        except work.FAILURES as error:
            return self.fail(error)
        bakes.refresh(context.scene)
        field_list.refresh(context.scene)
        work.say(f"{Path(self.filepath).name} deleted")
        return {"FINISHED"}


class PRT_OT_refresh(Button, bpy.types.Operator):
    """Look at the scene and the folder again: points, seconds, memory, warnings, bakes"""

    bl_idname = "prt.refresh"
    bl_label = "Check"
    bl_options = {"REGISTER"}
    object_mode = False

    def execute(self, context):
        scene = context.scene
        bakes.refresh(scene)
        field_list.refresh(scene)
        rate = bakes.rate(plan.back_end(scene))
        try:
            planned = run(plan.steps(scene, rays_per_second=rate))
        except work.FAILURES as error:
            return self.fail(error)
        cost = planned.cost
        self.report(
            {"INFO"},
            f"{cost.points:,} points, {cost.rays / 1e6:.1f} M rays, about {cost.seconds:.0f} s "
            f"with {planned.back_end}, {cost.memory_bytes / 1e6:.0f} MB",
        )
        return {"FINISHED"}


_CLASSES = (
    PRT_OT_bake,
    PRT_OT_cancel,
    PRT_OT_relight,
    PRT_OT_compress,
    PRT_OT_load,
    PRT_OT_clear,
    PRT_OT_remove,
    PRT_OT_refresh,
)
register, unregister = bpy.utils.register_classes_factory(_CLASSES)
