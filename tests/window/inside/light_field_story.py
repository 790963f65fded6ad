"""A light field by real clicks: loaded, orbited, dimmed, beside a bake, compressed, given back.

Then one is captured: where Blender has no cameras that are shaders, that of the bake.
"""

import time

import bpy
import numpy as np
from addon import install, part, status
from colours import attribute_of, from_light_field
from field_scene import build
from hand import FOLDER, Until
from mathutils import Quaternion
from rooms import press, to_panel

TURNS, DEGREES = 24, 6.0


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    build()
    settings = bpy.context.scene.prt
    settings.resolution, settings.tolerance = "8", 0.1
    settings.field.angles, settings.field.samples = (5, 3), 1
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "ball.blend"))
    yield from to_field_panel(hand)
    hand.picture("field 1 panel")
    report["steps"], report["beside"] = {}, {}
    for step in (load, orbit, dim, beside, undo, reload_file, compress, restore, capture):
        yield from step(hand, report)


def to_field_panel(hand):
    """The add-on's tab with the light field's panel open, which is closed at first."""
    panel = part("field_panel")
    panel.unregister()
    panel.PRT_PT_light_field.bl_options = set()
    panel.register()
    bpy.context.preferences.system.viewport_aa = "OFF"
    yield from to_panel(hand)
    hand.view.spaces.active.region_3d.view_perspective = "PERSP"
    yield 0.5


def on_ball():
    return attribute_of(bpy.data.objects["ball"], "PRT Light Field")


def settled():
    return (
        not status().running and part("live").idle() and part("following").idle(bpy.context.scene)
    )


def compare(hand, report, step):
    """Wait for quiet; what differs between the ball and the API, and who has which colours."""
    yield 0.3
    yield Until(f"the colours have settled ({step})", settled)
    shown, wanted = on_ball(), from_light_field("ball")
    report["steps"][step] = {
        "warned": part("light_fields").held().warned,
        "difference": float(np.abs(shown - wanted).max() / wanted.max()),
        "mean": shown.mean(axis=0).tolist(),
        "attributes": attributes(),
        "said": status().message,
        "failed": status().failed,
    }
    hand.picture(f"field {step}")


def attributes():
    return {n: list(bpy.data.objects[n].data.color_attributes.keys()) for n in ("ball", "floor")}


def load(hand, report):
    """The one of the folder, by its button under the list."""
    yield from press(hand, "prt.refresh", status, at=0.82)
    report["listed"] = [item.name for item in status().fields]
    yield from press(hand, "prt.light_field_load", status)
    yield from compare(hand, report, "loaded")


def orbit(hand, report):
    """The view turned step by step; seconds of our part, and of all until it is drawn."""
    following, region = part("following"), hand.view.spaces.active.region_3d
    before, drawn, steps = on_ball(), [], []
    handler = bpy.types.SpaceView3D.draw_handler_add(
        lambda: drawn.append(time.perf_counter()), (), "WINDOW", "POST_PIXEL"
    )
    following.frames.clear()
    turn = Quaternion((0, 0, 1), np.radians(DEGREES))
    for _ in range(TURNS):
        count, start = following.written[0], time.perf_counter()
        region.view_rotation = turn @ region.view_rotation
        yield Until(
            "the colours follow",
            lambda count=count, start=start: (
                following.written[0] > count and drawn and drawn[-1] > start
            ),
            60,
        )
        steps.append(time.perf_counter() - start)
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    report["orbit"] = {
        "frames": list(following.frames),
        "steps": steps,
        "points": len(part("light_fields").held().field),
        "kind": part("light_fields").held().viewer.kind,
        "changed": float(np.abs(on_ball() - before).max()),
    }
    yield from compare(hand, report, "orbited")


def dim(hand, report):
    """One lamp off by its slider's value, one recoloured; no table is made anew."""
    lamps, tables = bpy.context.scene.prt.field.lamps, part("light_fields").held().viewer
    path = f"prt.field.lamps[{lamps.find('warm')}].strength"
    yield from hand.drag(path, -150, at=0.8)
    yield from compare(hand, report, "dragged")
    report["dragged"] = lamps["warm"].strength
    lamps["warm"].strength = 0
    lamps["cold"].colour = 0.2, 1.0, 0.2
    yield from compare(hand, report, "dimmed")
    report["same_tables"] = part("light_fields").held().viewer is tables


def beside(hand, report):
    """A bake of the whole scene; the ball stays the light field's."""
    yield from press(hand, "prt.bake", status, seconds=400)
    yield from compare(hand, report, "beside")


def undo(hand, report):
    """The ball moved and back by Ctrl Z: the panel says so while it is elsewhere."""
    bpy.context.scene.prt.field.lamps["warm"].strength = 1
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.object.select_all(action="DESELECT")
    bpy.data.objects["ball"].select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["ball"]
    yield from hand.to_view()
    for key in ("G", "X"):
        yield from hand.key(key)
    yield from hand.type("1")
    yield from hand.key("RET")
    yield 1.0
    yield Until("it has settled", settled)
    report["moved"] = part("light_fields").held().warned
    yield from hand.key("Z", ctrl=True)
    yield 1.0
    yield from compare(hand, report, "undone")
    report["back"] = part("light_fields").held().warned


def reload_file(hand, report):
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.revert_mainfile()
    yield 0.5
    yield from compare(hand, report, "reloaded")


def compress(hand, report):
    """By its button, whose dialog is confirmed; the colours are then those of that form."""
    manager = bpy.context.window_manager
    chosen = manager.operator_properties_last("prt.light_field_compress")
    chosen.method, chosen.tolerance = "haar", 0.01
    yield from hand.click("prt.light_field_compress", at=0.3)
    yield 1.0
    hand.picture("field compress dialog")
    yield from hand.key("RET")
    yield Until("the work has begun", lambda: status().running, 20)
    yield Until("it is compressed", lambda: not status().running, 300)
    report["held"] = max(part("work").turns)
    yield from compare(hand, report, "compressed")
    report["form"] = status().message, part("light_fields").held().has_compressed


def restore(hand, report):
    yield from press(hand, "prt.light_field_clear", status)
    yield Until("the field is off", lambda: not bpy.context.scene.prt.field.loaded, 10)
    yield Until("the colours have settled", settled)
    report["left"] = attributes()
    hand.picture("field restored")


def capture(hand, report):
    """From the button: by Cycles where it can, else the field of the bake."""
    from prt_core.blender.compat import custom_camera_missing

    report["missing"] = custom_camera_missing()
    bpy.data.objects["ball"].select_set(True)
    yield from to_field_panel(hand)
    yield from press(hand, "prt.light_field_bake", status)
    yield from compare(hand, report, "captured")
    report["lights"] = list(part("light_fields").held().field.lights)
