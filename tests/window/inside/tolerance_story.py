"""A bake whose bounces miss the tolerance: what the panel says of it, baked, listed and loaded."""

import sys

import bpy
from addon import install, part, status
from hand import FOLDER
from rooms import floor_with, press, to_panel


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    floor_with("subdivided", "instanced", "shared")
    bpy.context.scene.prt.tolerance, bpy.context.scene.prt.method = 0.001, "exhaustive"
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "room.blend"))
    sys.modules["prt_core.bake.bounces"].MOST_ROUNDS = 2
    yield from to_panel(hand)
    yield from press(hand, "prt.bake", status)
    report["baked"] = said()
    # Away from the button, so that its help covers nothing.
    yield from hand.to_view()
    yield 1.5
    hand.picture("tolerance 1 baked")
    yield from press(hand, "prt.clear", status, at=0.75)
    report["restored"] = said()
    yield from press(hand, "prt.load", status, at=0.85)
    report["loaded"] = said()
    yield from hand.wheel("WHEELDOWNMOUSE", 30)
    yield from hand.to_view()
    yield 1.5
    hand.picture("tolerance 2 bakes")
    yield from hand.wheel("WHEELUPMOUSE", 30)
    yield from hand.to_view()
    yield 1.5
    hand.picture("tolerance 3 loaded")


def said():
    state, held = status(), part("preview").held()
    return {
        "message": state.message,
        "notes": state.notes.split("\n"),
        "listed": {item.name: item.notes.split("\n") for item in state.bakes},
        "met": held.bake.report["tolerance_met"] if held else None,
        "error": held.bake.report["error"] if held else None,
    }
