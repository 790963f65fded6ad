"""What is done with the colours next: kept attributes, sequences on disk, a turn of the light."""

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty, IntVectorProperty, StringProperty

from prt_core.blender import colours, exporters
from prt_core.blender.camera import read_camera
from prt_core.blender.compat import PATH_OPTIONS, fcurve_of
from prt_core.blender.realised import KEPT_COLLECTION
from prt_core.blender.view_transform import FILES, view_transform_of
from prt_core.errors import expect
from prt_core.runtime.progress import Progress

from . import freshness, plan, preview, work
from .buttons import Asks, BakeButton, Button, show_in_renders
from .request import request
from .work import LongWork

EACH_LIGHT = BoolProperty(
    name="Each Light Set",
    description="One for each light that is kept by name, at its full weight; otherwise their "
    "blend",
)


class PRT_OT_keep(Asks, LongWork, BakeButton, bpy.types.Operator):
    """Keep the colours as an attribute of the meshes that stays when the preview goes; gloss stays
    as it is seen at that moment"""

    bl_idname = "prt.keep"
    bl_label = "Keep Colours"
    title = "Keep Colours"
    call, asked = "keep", ("attribute", "domain", "kind", "channels", "each_light", "show")

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
    each_light: EACH_LIGHT
    show: show_in_renders("colours")

    def steps(self, context, pace):
        scene = self.begin(context)
        held = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
        yield from freshness.warn_steps(self, self.scene, held, pace)
        asked = request(self.scene).all_around()
        lights = asked.each() if self.each_light else [("", asked)]
        lights = {f"{self.attribute} {name}".strip(): light for name, light in lights}
        for attribute in lights:
            colours.expect_name(attribute)
            expect(
                attribute not in colours.names_of_preview(self.scene.prt.attribute),
                f"attribute: '{attribute}' is the preview's and goes with it; use another name",
            )
        radiances = {}
        for attribute, light in lights.items():
            radiances[attribute] = yield from light.steps(held, pace)
        return held, radiances

    def finish(self, context, result):
        held, radiances = result
        for attribute, radiance in radiances.items():
            self._keep(held, attribute, radiance)

    def _keep(self, held, attribute, radiance):
        scene = self.scene
        by_object = held.bake.colours(radiance)
        realised, left = colours.keep_all(
            held.bake.scene,
            by_object,
            attribute,
            self.domain,
            places=preview.places_now(scene, held),
            target=scene,
            byte=self.kind == "BYTE_COLOR",
            channels="".join(sorted(self.channels, key="RGB".index)),
            show=self.show,
        )
        text = f"'{attribute}' kept on {len(by_object)} objects"
        if realised:
            text += (
                f", {len(realised)} of them realised in the collection '{KEPT_COLLECTION}': they "
                "stand in for the originals when the preview is taken off"
            )
        notes = [f"{name}: was kept with another shape before, and is hidden now" for name in left]
        notes += exporters.offer(scene, attribute)
        for note in notes:
            self.report({"WARNING"}, note)
        self.report({"INFO"}, text)
        work.say(text, notes=notes)


class PRT_OT_export(LongWork, BakeButton, bpy.types.Operator):
    """Write the colours of a range of frames, one .npz (and picture, where wanted) a frame; with
    pictures gloss is seen from the camera"""

    bl_idname = "prt.export"
    bl_label = "Export Sequence"
    bl_options = {"REGISTER"}
    title = "Export"
    object_mode = False

    filepath: StringProperty(
        name="File", description="#### is the number of the frame", default="//prt/relit_####.npz",
        subtype="FILE_PATH", options=PATH_OPTIONS,
    )  # fmt: skip
    use_scene_range: BoolProperty(name="Scene Range", default=True)
    first: IntProperty(name="First", default=1)
    last: IntProperty(name="Last", default=1)
    pictures: BoolProperty(
        name="Pictures",
        description="A .png from the scene's camera beside each file, by the "
        "scene's view transform",
    )
    size: IntVectorProperty(name="Size", size=2, default=(960, 540), min=16, max=8192)
    each_light: EACH_LIGHT

    def invoke(self, context, event):
        if bpy.app.background:
            return self.execute(context)
        return context.window_manager.invoke_props_dialog(self)

    def steps(self, context, pace):
        from prt_core.evaluate.sequence import PictureWriter, frame_path, light_paths, write_npz

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
        sets = scene.prt.sets if self.each_light else ()
        paths = light_paths(pattern, [each.name for each in sets] or [""])
        self.begin(context)
        before, moved = scene.frame_current, []
        held = yield from preview.load_steps(preview.path_of(scene), scene.prt.caster)
        yield from freshness.warn_steps(self, self.scene, held, pace)
        pictures = PictureWriter(held.bake, tuple(self.size), scene.prt.caster)
        try:
            for count, frame in enumerate(frames):
                scene = self.scene
                scene.frame_set(frame)
                if not moved:
                    moved = self._say_moved(scene)
                asked = request(scene, rendered=self.pictures)
                for name, light in asked.each() if self.each_light else [("", asked)]:
                    radiance = yield from light.steps(held, pace)
                    path = frame_path(paths[name], frame)
                    write_npz(path, held.bake.colours(radiance))
                    if self.pictures:
                        camera, sky = read_camera(self.scene), light.sky(held)
                        pictures.view_transform = view_transform_of(self.scene, FILES)
                        pictures.write(path.with_suffix(".png"), radiance, camera, sky)
                yield Progress("frames", count + 1, len(frames))
        finally:
            self.scene.frame_set(before)
        return frame_path(pattern, frames[0]), len(frames)

    def _say_moved(self, scene):
        """Say what is not where it was baked in a frame; returns the names."""
        names = plan.moved(scene)
        if names:
            differs = f"{', '.join(names[:3])} at frame {scene.frame_current}"
            self.report({"WARNING"}, freshness.note(scene, differs))
        return names

    def finish(self, context, result):
        text = f"{result[1]} frames written, the first is {result[0]}"
        self.report({"INFO"}, text)
        work.say(text)


class PRT_OT_turntable(Button, bpy.types.Operator):
    """Keyframe one turn of the light over the scene's frames"""

    bl_idname = "prt.turntable"
    bl_label = "Keyframe a Turn"
    object_mode = False

    def execute(self, context):
        scene = context.scene
        start = scene.prt.rotation
        _forget_between(scene, scene.frame_start, scene.frame_end + 1)
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


def _forget_between(scene, first, last):
    """Take away keyframes of the rotation between two frames, at which the turn would stop."""
    curve = fcurve_of(scene, "prt.rotation")
    if curve is None:
        return
    for key in reversed(curve.keyframe_points):
        if first < key.co.x < last:
            curve.keyframe_points.remove(key)


register, unregister = bpy.utils.register_classes_factory(
    (PRT_OT_keep, PRT_OT_export, PRT_OT_turntable)
)
