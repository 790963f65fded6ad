"""Buttons of the lights that are kept by name: day, night, dusk, each with a weight."""

import bpy
from bpy.props import IntProperty

from . import live, preview, work
from .buttons import Button
from .light_properties import Light

# What the panel's own light and a set have in common.
_VALUES = [name for name in Light.__annotations__ if name != "emitters"]
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
        source = settings.sets[settings.active_set] if count else settings
        _copy(source, added)
        added.name = "Light"
        added.weight = 0.0 if count else 1.0
        settings.active_set = count
        add_rows(context.scene)
        return {"FINISHED"}


def _copy(source, target):
    for name in _VALUES:
        setattr(target, name, getattr(source, name))
    for kind in ("emitters", "lamps"):
        for item in getattr(source, kind, ()):
            copied = getattr(target, kind).add()
            for name in _HOW:
                setattr(copied, name, getattr(item, name))


def add_rows(scene):
    """Each set has a row for each lamp of the scene and for each emitter of the bake that is
    shown."""
    emitters = preview.emitters(preview.held(scene))
    lamps = [item.name_full for item in scene.objects if item.type == "LIGHT"]
    for each in scene.prt.sets:
        for rows, names in ((each.emitters, emitters), (each.lamps, lamps)):
            for name in names:
                if name not in rows:
                    rows.add().name = name


class PRT_OT_light_set_remove(_SetButton, bpy.types.Operator):
    """Forget the chosen light; without any the panel's own shines again"""

    bl_idname = "prt.light_set_remove"
    bl_label = "Forget Light Set"

    def execute(self, context):
        settings = context.scene.prt
        settings.sets.remove(min(settings.active_set, len(settings.sets) - 1))
        settings.active_set = max(0, settings.active_set - 1)
        live.touch(context.scene)
        live.start()
        return {"FINISHED"}


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
        PRT_UL_light_sets,
    )
)
