"""Lightmaps: what surfaces receive, or show, as one image of several objects, by UV maps."""

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty, IntVectorProperty, StringProperty

from prt_core import LightBlend, PRTError, WeightedLight, load
from prt_core.api import bake_blend_steps
from prt_core.bake.images import ImageSettings
from prt_core.blender.compat import PATH_OPTIONS
from prt_core.blender.lightmaps import UV_MAP, load_lightmap, wear_lightmap
from prt_core.errors import expect
from prt_core.evaluate import to_srgb, write_png
from prt_core.evaluate.sequence import light_paths
from prt_core.light import write_image
from prt_core.relight.lights_apart import lights_apart
from prt_core.runtime.files import expect_output
from prt_core.runtime.main_thread import in_thread
from prt_core.scene import changes

from . import bakes, plan, work
from .buttons import Asks, Button, show_in_renders
from .request import request
from .shapes import chosen_names
from .work import LongWork

_SUFFIX = {"PNG": ".png", "PNG16": ".png", "EXR": ".exr"}


class PRT_OT_lightmap(Asks, LongWork, Button, bpy.types.Operator):
    """Bake the light on objects into one image, by UV maps: a lightmap. Its rays are kept as a bake
    of its own, so that another light takes moments"""

    bl_idname = "prt.lightmap"
    bl_label = "Bake Lightmap"
    title = "Lightmap"
    call = "lightmap"
    asked = (
        "filepath", "format", "size", "selected", "uv", "margin", "light_only", "apart", "show",
    )  # fmt: skip

    filepath: StringProperty(
        name="File", description="Where the image goes; the format decides on its suffix",
        default="//prt/lightmap", subtype="FILE_PATH", options=PATH_OPTIONS,
    )  # fmt: skip
    selected: BoolProperty(
        name="Selected Only", description="Only selected objects are in the image; else all that "
        "receive",
    )  # fmt: skip
    size: IntVectorProperty(
        name="Size", description="Width and height, in texels", size=2, default=(512, 512), min=16,
        max=8192,
    )  # fmt: skip
    uv: EnumProperty(
        name="UV Map",
        items=[
            ("new", "New", f"Unwrap the objects anew, into UV maps '{UV_MAP}'"),
            ("packed", "Pack Own", f"Their own charts, scaled by area and packed apart, into UV "
             f"maps '{UV_MAP}'"),
            ("own", "Own, as It Is", "The UV map that renders take; objects must not overlap"),
        ],
    )  # fmt: skip
    margin: IntProperty(
        name="Margin", description="Texels between charts, where they are packed", default=4, min=0,
        max=64,
    )  # fmt: skip
    format: EnumProperty(
        name="Format",
        items=[
            ("PNG", "PNG, 8 Bits", "sRGB, cut at 1"),
            ("PNG16", "PNG, 16 Bits", "sRGB, cut at 1"),
            ("EXR", "OpenEXR", "32 bits, linear; nothing is lost"),
        ],
        default="EXR",
    )
    light_only: BoolProperty(
        name="Light Only", description="What surfaces receive, without their colour: materials "
        "multiply with it", default=True,
    )  # fmt: skip
    apart: BoolProperty(
        name="Each Light Apart", description="An image of the environment, of each lamp and of the "
        "emission, whose sum is the light",
    )  # fmt: skip
    show: show_in_renders("lightmap")

    def draw(self, _context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in self.asked:
            row = layout.row()
            row.enabled = name != "margin" or self.uv != "own"
            row.prop(self, name)

    def steps(self, context, pace):
        scene = self.begin(context)
        chosen = None
        if self.selected:
            chosen = chosen_names(context, "lightmap", "objects, or bake all")
        expect(
            bpy.data.filepath or not self.filepath.startswith("//"),
            "file: save the scene first, or give a full path",
        )
        target = _target(self.filepath, _SUFFIX[self.format])
        expect_output("file", target, _SUFFIX[self.format], create=True)
        asked = ImageSettings(
            atlas=tuple(self.size), atlas_objects=chosen, atlas_uv=self.uv, atlas_margin=self.margin
        )
        path = lightmap_path(scene)
        bakes.expect_ours(scene, path)
        bake = yield from self._earlier_steps(path, asked, pace)
        if bake is None:
            scene = self.scene
            yield from bake_blend_steps(
                None,
                path,
                plan.bake_settings(scene),
                plan.receivers(scene),
                plan.two_sided(scene),
                "changed",
                pace,
                scene,
                strict=False,
                image=asked,
            )
            bake = yield from in_thread("load", load, path)
        wanted = request(self.scene)
        parts = self._lights(bake, wanted)
        paths = light_paths(target, [name for name, _ in parts])
        blend, files = LightBlend(bake, self.scene.prt.caster, wanted.form), []
        self.cut = 0.0
        try:
            for name, lights in parts:
                radiance = yield from blend.steps(lights, pace)
                values = blend.received if self.light_only else radiance
                files.append(paths[name])
                yield from in_thread("image", self._write, files[-1], bake, values)
        finally:
            blend.close()
        return bake, files

    def _lights(self, bake, wanted):
        """(name, lights) of each image: of each set alone, or of each lamp where there is none."""
        if not self.apart:
            return [("", wanted.lights)]
        if self.scene.prt.sets:
            return [(light.name, (replace(light, weight=1.0),)) for light in wanted.lights]
        apart = lights_apart(bake, wanted.lighting)
        return [(name, (WeightedLight(name, lighting),)) for name, lighting in apart]

    def _earlier_steps(self, path, asked, pace):
        """The bake of an earlier lightmap where it is still of the scene, else None.

        Realised objects change in which order the scene is read, which a bake would begin anew for.
        """
        if asked.atlas_uv == "packed" or not path.is_dir():
            return None
        try:
            bake = yield from in_thread("load", load, path)
        except PRTError:
            return None
        image, settings = bake.scene.image, plan.bake_settings(self.scene)
        if getattr(image, "atlas", None) is None or bake.settings != settings.stored():
            return None
        if image.atlas.made != asked.atlas_made or (image.width, image.height) != asked.atlas:
            return None
        uid = self.scene.session_uid
        meshes = yield from plan.read_steps(self.scene, pace=pace, gloss=settings.gloss)
        differences = changes(bake.source, plan.reading_of(uid).digests)
        fresh = differences.fresh and not differences.renamed
        if fresh and image.atlas.own:
            # UV maps are not among what tells meshes apart.
            maps = {mesh.name: mesh.corner_uv for mesh in meshes}
            fresh = all(
                maps[name] is not None and np.array_equal(maps[name].astype(np.float32), uv)
                for name, uv in image.atlas.corner_uv.items()
            )
        return bake if fresh else None

    def _write(self, path, bake, values):
        pixels = bake.image(values)
        if self.format == "EXR":
            write_image(path, pixels)
        else:
            self.cut = max(self.cut, float((pixels > 1).any(axis=-1).mean()))
            write_png(path, to_srgb(pixels, bits=16 if self.format == "PNG16" else 8))

    def stopped(self, context):
        bakes.refresh(context.scene)

    def finish(self, context, result):
        bake, files = result
        images = [load_lightmap(path) for path in files]
        realised = wear_lightmap(bake.scene, images[0], target=self.scene, show=self.show)
        bakes.refresh(self.scene)
        text = f"{len(images)} lightmaps" if len(images) > 1 else f"Lightmap '{images[0].name}'"
        text += f" of {len(bake.scene.image.atlas.corner_uv)} objects, in {files[0].parent}"
        if not bake.scene.image.atlas.own:
            text += f", by the UV maps '{UV_MAP}'"
        if realised:
            text += f"; {len(realised)} of them realised, for they have no mesh of their own"
        notes = list(bake.report["messages"])
        if self.cut > 0:
            notes.append(
                f"{self.cut:.1%} of the texels are brighter than white and cut; lower the Exposure "
                "or take OpenEXR"
            )
        for note in notes:
            self.report({"WARNING"}, note)
        self.report({"INFO"}, text)
        work.say(text, notes=notes)


def _target(filepath, suffix):
    """Where the image goes: the suffix takes the place of another image's, and of nothing else."""
    path = Path(bpy.path.abspath(filepath))
    image = path.suffix.lower() in bpy.path.extensions_image
    return path.with_name((path.stem if image else path.name) + suffix)


def lightmap_path(scene):
    """Where the bake of a scene's lightmap is kept: beside that of its meshes."""
    path = plan.output_path(scene)
    return path.with_name(f"{path.stem} lightmap{path.suffix}")


register, unregister = bpy.utils.register_classes_factory((PRT_OT_lightmap,))
