"""The shown bake for other programs: a glTF file under the light of the panel."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from prt_core.api import export_glb_steps
from prt_core.errors import expect
from prt_core.export.glb import GLBSettings
from prt_core.export.glb.settings import MOST_COMPONENTS

from . import freshness, preview, work
from .buttons import BakeButton
from .request import request
from .work import LongWork


class PRT_OT_export_glb(LongWork, BakeButton, bpy.types.Operator, ExportHelper):
    """Write the shown bake under the panel's light as a .glb, for game engines and browsers; of
    light sets each goes out beside their blend"""

    bl_idname = "prt.export_glb"
    bl_label = "Export Relit glTF"
    bl_options = {"REGISTER"}
    title = "Export glTF"
    object_mode = False
    when_stopped = "nothing was written"

    filename_ext = ".glb"
    filter_glob: StringProperty(default="*.glb", options={"HIDDEN"})
    material: EnumProperty(
        name="Material",
        items=[
            ("unlit", "Unlit", "Colours are shown as they are, with the colours of surfaces in"),
            ("multiplied", "Multiplied", "Colours are the light, which base colours multiply"),
        ],
    )
    light_only: BoolProperty(
        name="Light Only", description="The light that surfaces receive, without their own colours"
    )
    encoding: EnumProperty(
        name="Colours",
        items=[("float", "Float", "32 bits a channel"), ("u16", "16 Bits", "Half the size")],
    )
    weights: BoolProperty(
        name="Weights",
        description="For engines that relight: weights of the compressed form, made by the method "
        "cpca",
    )
    components: IntProperty(
        name="Components", description="Weights of a vertex at most",
        default=GLBSettings.components, min=1, max=MOST_COMPONENTS,
    )  # fmt: skip
    harmonics: BoolProperty(
        name="Harmonics", description="For engines that relight: nine harmonics a vertex, soft"
    )

    _chosen = False

    def invoke(self, context, event):
        if not work.has_window(context):
            return self.execute(context)
        if not self.filepath:
            name = Path(preview.path_of(context.scene)).with_suffix(".glb").name
            folder = Path(bpy.data.filepath).parent if bpy.data.filepath else Path.home()
            self.filepath = str(folder / name)
        self._chosen = True
        return ExportHelper.invoke(self, context, event)

    def execute(self, context):
        # After the file dialog the window is there, and must not be held.
        if self._chosen and work.has_window(context):
            return LongWork.invoke(self, context, None)
        return LongWork.execute(self, context)

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "material")
        row = layout.row()
        row.enabled = self.material == "unlit"
        row.prop(self, "light_only")
        layout.prop(self, "encoding")
        layout.prop(self, "weights")
        row = layout.row()
        row.enabled = self.weights
        row.prop(self, "components")
        layout.prop(self, "harmonics")

    def steps(self, context, pace):
        scene = self.begin(context)
        expect(
            bpy.data.filepath or not self.filepath.startswith("//"),
            "file: save the scene first, or give a full path",
        )
        path = bpy.path.ensure_ext(bpy.path.abspath(self.filepath), self.filename_ext)
        settings = GLBSettings(
            colours="light" if self.light_only else None,
            material=self.material,
            weights=self.weights,
            harmonics=self.harmonics,
            encoding=self.encoding,
            components=self.components,
        )
        held = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
        yield from freshness.warn_steps(self, self.scene, held, pace)
        asked = request(self.scene).all_around()
        held.blend.form = asked.form
        view = None if settings.of_light else asked.view_of(held)
        report = yield from export_glb_steps(
            held.bake, path, asked.lights, settings, self.scene.prt.caster, view=view, pace=pace,
            blend=held.blend,
        )  # fmt: skip
        return path, report

    def finish(self, context, result):
        path, report = result
        text = (
            f"{Path(path).name}: {report['objects']} objects, {report['vertices']:,} vertices, "
            f"{report['bytes'] / 1e6:.1f} MB"
        )
        for note in report["notes"]:
            self.report({"WARNING"}, note)
        self.report({"INFO"}, text)
        work.say(text, notes=report["notes"])


def _entry(menu, _context):
    menu.layout.operator(PRT_OT_export_glb.bl_idname, text="Relit glTF (.glb)")


def register():
    bpy.utils.register_class(PRT_OT_export_glb)
    bpy.types.TOPBAR_MT_file_export.append(_entry)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(_entry)
    bpy.utils.unregister_class(PRT_OT_export_glb)
