"""Buttons of the lights that are kept by name: day, night, dusk, each with a weight."""

import re

import bpy
import numpy as np
from bpy.props import IntProperty, StringProperty

from prt_core.blender.compat import PATH_OPTIONS, animations_of
from prt_core.errors import expect
from prt_core.relight.light_file import write_lights

from . import live, preview, work
from .buttons import Button
from .light_properties import Light
from .request import image_of

# What the panel's own light and a set have in common.
_VALUES = [name for name in Light.__annotations__ if name != "emitters"]
_SET = re.compile(r"prt\.sets\[(\d+)\]")
_HOW = ("name", "strength", "recolour", "colour")


class _SetButton(Button):
    """Needs a set."""

    object_mode = False

    @classmethod
    def why_not(cls, context):
        if not context.scene.prt.sets:
            return "Keep the light as a set first"
        return super().why_not(context)


class PRT_OT_light_set_add(Button, bpy.types.Operator):
    """Keep the light as it is by a name; the next one begins as a copy of the one chosen, and is
    blended with it"""

    bl_idname = "prt.light_set_add"
    bl_label = "Keep as a Light Set"
    object_mode = False

    def execute(self, context):
        settings = context.scene.prt
        count = len(settings.sets)
        added = settings.sets.add()
        # Whatever was added to the collection before may lie elsewhere by now.
        source = settings.sets[min(settings.active_set, count - 1)] if count else settings
        _copy(source, added)
        added.name = "Light"
        added.weight = 0.0 if count else 1.0
        settings.active_set = count
        preview.add_rows(context.scene)
        return {"FINISHED"}


def _copy(source, target):
    for name in _VALUES:
        setattr(target, name, getattr(source, name))
    for kind in ("emitters", "lamps"):
        for item in getattr(source, kind, ()):
            copied = getattr(target, kind).add()
            for name in _HOW:
                setattr(copied, name, getattr(item, name))


class PRT_OT_light_set_remove(_SetButton, bpy.types.Operator):
    """Forget the chosen light; without any the panel's own shines again"""

    bl_idname = "prt.light_set_remove"
    bl_label = "Forget Light Set"

    def execute(self, context):
        settings = context.scene.prt
        index = min(settings.active_set, len(settings.sets) - 1)
        settings.sets.remove(index)
        _forget_keys(context.scene, index)
        settings.active_set = max(0, index - 1)
        live.touch(context.scene)
        live.start()
        return {"FINISHED"}


def _forget_keys(scene, index):
    """Take away the animation of a set that is gone; those behind it keep theirs.

    Animation knows a set by its place, which is another one now.
    """
    for curves in animations_of(scene):
        for curve in list(curves):
            match = _SET.match(curve.data_path)
            place = int(match[1]) if match else -1
            if place == index:
                curves.remove(curve)
            elif place > index:
                curve.data_path = f"prt.sets[{place - 1}]{curve.data_path[match.end() :]}"


class PRT_OT_light_set_only(_SetButton, bpy.types.Operator):
    """Switch to this light alone"""

    bl_idname = "prt.light_set_only"
    bl_label = "Only This Light"

    index: IntProperty(name="Light", default=-1, description="-1: the chosen one", min=-1)

    def execute(self, context):
        settings = context.scene.prt
        chosen = settings.active_set if self.index < 0 else self.index
        if not 0 <= chosen < len(settings.sets):
            return self.fail(f"light set: there are {len(settings.sets)}, asked for {chosen + 1}")
        settings.active_set = chosen
        for index, each in enumerate(settings.sets):
            each.weight = float(index == chosen)
        return {"FINISHED"}


class PRT_OT_light_set_key(_SetButton, bpy.types.Operator):
    """Keyframe the weights of all lights at this frame, so that playback blends them"""

    bl_idname = "prt.light_set_key"
    bl_label = "Keyframe Weights"

    def execute(self, context):
        scene = context.scene
        for index in range(len(scene.prt.sets)):
            scene.keyframe_insert(f"prt.sets[{index}].weight", frame=scene.frame_current)
        work.say(f"Weights of {len(scene.prt.sets)} lights keyed at frame {scene.frame_current}")
        return {"FINISHED"}


class PRT_OT_export_lights(_SetButton, bpy.types.Operator):
    """Write the lights that are kept as a .json file, for prt relight --lights"""

    bl_idname = "prt.export_lights"
    bl_label = "Export Lights"
    bl_options = {"REGISTER"}

    filepath: StringProperty(
        name="File", default="//prt/lights.json", subtype="FILE_PATH", options=PATH_OPTIONS
    )

    def invoke(self, context, _event):
        if not work.has_window(context):
            return self.execute(context)
        return context.window_manager.invoke_props_dialog(self, confirm_text="Export")

    def execute(self, context):
        scene = context.scene
        try:
            expect(
                bpy.data.filepath or not self.filepath.startswith("//"),
                "file: save the scene first, or give a full path",
            )
            path = bpy.path.abspath(self.filepath)
            write_lights(path, as_values(scene))
        except work.FAILURES as error:
            return self.fail(error)
        work.say(f"{len(scene.prt.sets)} lights written to {path}")
        return {"FINISHED"}


def as_values(scene):
    """What a file of a scene's lights holds, by their names."""
    return {each.name: _as_values(each) for each in scene.prt.sets}


def _as_values(light):
    """What of a set a file of lights holds.

    Raises
    ------
    PRTError
        It turns the world, which a bake knows as it was, or colours a lamp.
    """
    values = {"weight": light.weight, "strength": light.strength, "sharp_sun": light.sharp_sun}
    if light.light == "WORLD":
        expect(
            light.rotation == 0 and not light.sharp_sun,
            f"light '{light.name}': turns the world, or has its sun apart, which only an image "
            "can; choose its image",
        )
        values["environment"], values["sharp_sun"] = "world", False
    else:
        values["environment"] = str(image_of(light))
        values["rotation"] = float(np.degrees(light.rotation))
    coloured = [item.name for item in light.lamps if item.recolour]
    expect(
        not (coloured and light.use_lamps),
        f"light '{light.name}': gives the lamp '{coloured and coloured[0]}' another colour, which "
        "a file of lights has no place for",
    )
    values["lamp_strength"], values["lamp_samples"] = 1.0, light.lamp_samples
    values["lamps"] = {item.name: item.strength for item in light.lamps} if light.use_lamps else {}
    if not light.use_lamps:
        values["lamps"] = False
    values["emission"] = {
        item.name: [list(item.colour), item.strength] if item.recolour else item.strength
        for item in light.emitters
    }
    return values


class PRT_UL_light_sets(bpy.types.UIList):
    """Lights by name, each with its weight and a button that switches to it."""

    def draw_item(self, _context, layout, _data, item, _icon, _active, _property, index):
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon="LIGHT")
        row.prop(item, "weight", text="", slider=True)
        row.operator("prt.light_set_only", text="", icon="RADIOBUT_ON").index = index


register, unregister = bpy.utils.register_classes_factory(
    (
        PRT_OT_light_set_add,
        PRT_OT_light_set_remove,
        PRT_OT_light_set_only,
        PRT_OT_light_set_key,
        PRT_OT_export_lights,
        PRT_UL_light_sets,
    )
)
