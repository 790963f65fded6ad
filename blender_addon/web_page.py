"""The bake as a web page: the button, and the page in the browser afterwards."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from prt_core.api import export_web_steps
from prt_core.blender.compat import PATH_OPTIONS
from prt_core.errors import expect

from . import freshness, light_sets, live, preview, work
from .buttons import BakeButton
from .work import LongWork


class _Page:
    """What is asked of a page, in its dialog and in its work."""

    object_mode = False

    filepath: StringProperty(
        name="To", description="A folder, or one file whose name ends in .html",
        default="//prt/page.html", subtype="FILE_PATH", options=PATH_OPTIONS,
    )  # fmt: skip
    suns: EnumProperty(
        name="Suns",
        items=[
            ("SHARP", "Sharp", "With the visibility of every texel: the larger page"),
            ("SOFT", "Soft", "A small page, on which hard suns are blurred"),
        ],
    )
    sets: BoolProperty(
        name="Buttons for Light Sets", description="Of the lights that are kept by name",
        default=True,
    )  # fmt: skip
    show: BoolProperty(name="Open in the Browser", default=True)


class PRT_OT_web_page(_Page, LongWork, BakeButton, bpy.types.Operator):
    """Write the loaded bake as a web page that opens from disk and relights it"""

    bl_idname = "prt.web_page"
    bl_label = "Export Web Page"
    bl_options = {"REGISTER"}
    title = "Web Page"
    when_stopped = "nothing was written"

    def steps(self, context, pace):
        scene = self.begin(context)
        expect(
            bpy.data.filepath or not self.filepath.startswith("//"),
            "page: save the scene first, or give a full path",
        )
        output = Path(bpy.path.abspath(self.filepath))
        live.stop()
        held = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
        yield from freshness.warn_steps(self, self.scene, held, pace)
        settings = {"bits": self.suns == "SHARP", "caster": self.scene.prt.caster}
        if self.sets and self.scene.prt.sets:
            settings["sets"] = light_sets.as_values(self.scene)
        return (yield from export_web_steps(held.bake, output, pace=pace, **settings))

    def finish(self, context, report):
        page = Path(report["output"])
        page = page / "index.html" if page.is_dir() else page
        text = (
            f"{page.name}: {report['bytes'] / 1e6:.1f} MB, error {report['error']:.2%} in the mean"
        )
        work.say(f"Web page written to {page}", notes=report["notes"])
        self.report({"INFO"}, text)
        if self.show and not bpy.app.background:
            bpy.ops.wm.url_open(url=page.resolve().as_uri())


class PRT_OT_web_page_dialog(_Page, BakeButton, bpy.types.Operator):
    """Write the loaded bake as a web page that opens from disk and relights it: drop an image of
    light on it, turn it, look around"""

    bl_idname = "prt.web_page_dialog"
    bl_label = "Export Web Page"
    bl_options = {"REGISTER"}

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self, width=420)

    def execute(self, context):
        # The work is an operator of its own, so that the window lives while it is done.
        settings = {name: getattr(self, name) for name in _Page.__annotations__}
        return bpy.ops.prt.web_page("INVOKE_DEFAULT", **settings)


register, unregister = bpy.utils.register_classes_factory((PRT_OT_web_page, PRT_OT_web_page_dialog))
