"""What the buttons of the light field do; a script that calls the same operators gets the same."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty

from prt_core import PRTError
from prt_core.api.light_field import light_field_steps
from prt_core.bake.light_field import LightFieldSettings
from prt_core.bake.light_field_compress import TOLERANCE, compress_light_field_steps
from prt_core.blender.compat import PATH_OPTIONS, custom_camera_missing
from prt_core.errors import expect
from prt_core.runtime.main_thread import MainThreadCalls, steps_in_thread
from prt_core.runtime.progress import run

from . import field_list, following, light_fields, live, plan, preview, saving, views, work
from .buttons import Asks, Button
from .shapes import chosen_names
from .work import LongWork

# A bake's surfaces look the same from all sides: as few directions as a field can have.
_SAME_FROM_ALL_SIDES = 2, 2


class PRT_OT_light_field_bake(LongWork, Button, bpy.types.Operator):
    """Capture what the selected objects look like from all sides, with any material; \
what was stopped goes on where it was"""

    bl_idname = "prt.light_field_bake"
    bl_label = "Bake Light Field"
    title = "Light field"

    from_bake: BoolProperty(
        name="From the Bake",
        description="The field of the loaded bake by its own transport, not a render by Cycles",
    )
    restart: BoolProperty(
        name="Restart", description="Begin anew even where the light field is there already",
        options={"SKIP_SAVE"},
    )  # fmt: skip

    def steps(self, context, pace):
        scene = self.begin(context)
        source, objects, two_sided = None, None, ()
        settings = LightFieldSettings(
            tuple(scene.prt.field.angles), scene.prt.field.samples,
            denoise=scene.prt.field.denoise,
        )  # fmt: skip
        if self.from_bake:
            expect(scene.prt.loaded, "light field: bake the scene, or load a bake, first")
            source = preview.path_of(scene)
            settings = LightFieldSettings(_SAME_FROM_ALL_SIDES, 1)
        else:
            missing = custom_camera_missing()
            expect(
                missing is None,
                f"light field: {missing}, or take the field of a bake of the scene",
            )
            objects = chosen_names(context, "light field", "what it is to be of")
            two_sided = [name for name in plan.two_sided(scene) if name in objects]
        self.path = path = field_list.output_path(scene)
        field_list.expect_ours(scene, path)
        path.parent.mkdir(parents=True, exist_ok=True)
        live.stop()
        self.report_line = yield from light_field_steps(
            source,
            path,
            settings,
            objects,
            two_sided,
            lamps=scene.prt.field.each,
            restart=self.restart or "changed",
            pace=pace,
            scene=scene,
        )
        light_fields.forget()
        self.path = saving.settle(self.scene, path)
        compressed = self.scene.prt.field.use_compressed
        return (yield from light_fields.load_steps(self.path, compressed))

    def stopped(self, context):
        saving.settle(self.scene, self.path)
        field_list.refresh(context.scene)

    def finish(self, context, result):
        _show(self.scene, result)
        line = self.report_line
        text = f"Light field of {line['points']:,} points in {line['seconds']:.1f} s, "
        text += f"noise {line['noise']:.1%}"
        for message in line["messages"]:
            self.report({"WARNING"}, message)
        self.report({"INFO"}, text)
        work.say(text, notes=line["messages"])


class PRT_OT_light_field_load(LongWork, Button, bpy.types.Operator):
    """Load a light field and show it"""

    bl_idname = "prt.light_field_load"
    bl_label = "Load Light Field"
    title = "Load"

    filepath: StringProperty(
        name="Light Field", description="NAME.slf", subtype="DIR_PATH", options=PATH_OPTIONS
    )

    def steps(self, context, pace):
        scene = self.begin(context)
        chosen = self.filepath
        path = Path(bpy.path.abspath(chosen)) if chosen else field_list.output_path(scene)
        live.stop()
        return (yield from light_fields.load_steps(path, scene.prt.field.use_compressed))

    def finish(self, context, result):
        scene = self.scene
        _show(scene, result)
        if result.warned:
            self.report({"WARNING"}, result.warned)
        work.say(f"{Path(result.path).name} loaded", notes=result.field.report["messages"])


def _show(scene, shown):
    """Show a light field that is in memory, in place of what the scene shows."""
    before = scene.prt.field.loaded
    shown.shown = None
    scene.prt.field.loaded = preview.relative(shown.path)
    try:
        run(following.show_steps(scene))
    except PRTError:
        scene.prt.field.loaded = before
        raise
    light_fields.check_moved(scene, shown)
    live.note_preview()
    views.show()
    field_list.refresh(scene, select=shown.path)


class PRT_OT_light_field_compress(Asks, LongWork, Button, bpy.types.Operator):
    """Keep the light field that is shown in fewer bytes beside it, and show that form"""

    bl_idname = "prt.light_field_compress"
    bl_label = "Compress Light Field"
    title = "Compress"
    when_stopped = "what there was is as before"

    method: EnumProperty(
        name="Method",
        items=[
            ("ceob", "Exemplar Bases", "Pairs of bases that are learned; smallest, and slow"),
            ("cpca", "Clustered PCA", "Principal components of alike points"),
            ("ksvd", "K-SVD", "Learned atoms, few of them a point"),
            ("harmonics", "Harmonics", "Of the hemisphere; for soft light"),
            ("haar", "Haar Wavelets", "Nothing is learned; quick"),
            ("dct", "Cosines", "Nothing is learned; quick"),
            ("none", "None", "Remove the compressed form"),
        ],
    )
    goal: EnumProperty(
        name="Until",
        items=[
            ("ERROR", "Error", "As small as the error allows"),
            ("SIZE", "Size", "As near as the size allows"),
        ],
    )
    tolerance: FloatProperty(
        name="Error",
        description="Root mean square error of a direction, as a share of the white level",
        default=TOLERANCE, min=1e-4, max=0.5, precision=4,
    )  # fmt: skip
    megabytes: FloatProperty(
        name="Megabytes", description="10^6 bytes on disk, at most", default=1.0, min=1e-3,
        soft_max=1e3, precision=3,
    )  # fmt: skip
    call, asked = "light_field_compress", ("method", "goal", "tolerance", "megabytes")

    @classmethod
    def why_not(cls, context):
        if not light_fields.path_of(context.scene):
            return "Bake a light field, or load one, first"
        return super().why_not(context)

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "method")
        if self.method != "none":
            layout.row().prop(self, "goal", expand=True)
            layout.prop(self, "tolerance" if self.goal == "ERROR" else "megabytes")

    def steps(self, context, _pace):
        scene = self.begin(context)
        path, goals = light_fields.path_of(scene), {}
        if self.method != "none":
            by_error = self.goal == "ERROR"
            goals = {"tolerance": self.tolerance} if by_error else {"megabytes": self.megabytes}
        live.stop()
        steps = compress_light_field_steps(path, self.method, **goals)
        self.form_report = yield from steps_in_thread(steps, MainThreadCalls(), "compress")
        light_fields.forget()
        return (yield from light_fields.load_steps(path, True))

    def finish(self, context, result):
        self.scene.prt.field.use_compressed = True
        _show(self.scene, result)
        report = self.form_report
        if report is None:
            work.say("The compressed form is gone")
            return
        share = report["coded_nbytes"] / report["raw_nbytes"]
        text = (
            f"Compressed by {report['method']} to {report['coded_nbytes'] / 1e6:.3g} MB, "
            f"{share:.1%} of what it was, error {report['error']:.2%} of white"
        )
        self.report({"INFO"}, text)
        work.say(text)


class PRT_OT_light_field_clear(Button, bpy.types.Operator):
    """Take the light field off: its objects are as before, or show the bake again"""

    bl_idname = "prt.light_field_clear"
    bl_label = "Restore"

    def execute(self, context):
        scene = context.scene
        live.stop()
        scene.prt.field.loaded = ""
        changed = light_fields.clear(scene)
        light_fields.forget()
        live.note_preview()
        if scene.prt.loaded:
            live.touch(scene, show=True)
        else:
            views.restore()
        work.say(f"{changed} {'object is' if changed == 1 else 'objects are'} as before")
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory(
    (
        PRT_OT_light_field_bake,
        PRT_OT_light_field_load,
        PRT_OT_light_field_compress,
        PRT_OT_light_field_clear,
    )
)
