"""A bake whose bounces miss the tolerance: what the panel says of it, baked, listed and loaded."""

import bpy
from hand import FOLDER
from relight_story import install, part, status
from rooms import floor_with, press, to_panel


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    dark_room()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "room.blend"))
    yield from to_panel(hand)
    yield from press(hand, "prt.bake", status)
    report["baked"] = said()
    # Away from the button, so that its help covers nothing.
    yield from hand.to_view()
    yield 1.5
    hand.picture("tolerance 1 baked")
    yield from press(hand, "prt.clear", status, at=0.75)
    report["restored"] = said()
    yield from press(hand, "prt.load", status)
    report["loaded"] = said()
    yield from hand.to_view()
    yield 1.5
    hand.picture("tolerance 2 bakes")
    yield from hand.wheel("WHEELUPMOUSE", 30)
    yield from hand.to_view()
    yield 1.5
    hand.picture("tolerance 3 loaded")


def dark_room():
    """A closed box but for a slit, in which nearly all light is bounced light."""
    floor_with()
    mesh = bpy.data.meshes.new("room")
    corners = [(x, y, z) for z in (0, 2) for y in (-1, 1) for x in (-1, 1)]
    faces = [(0, 1, 3, 2), (0, 4, 5, 1), (1, 5, 7, 3), (3, 7, 6, 2), (2, 6, 4, 0)]
    lid = [(-1, -1, 2), (0.9, -1, 2), (0.9, 1, 2), (-1, 1, 2)]
    mesh.from_pydata(corners + lid, [], [*faces, (8, 11, 10, 9)])
    item = bpy.data.objects.new("room", mesh)
    bpy.context.scene.collection.objects.link(item)
    item.location.z = 0.1
    settings = bpy.context.scene.prt
    settings.tolerance, settings.method = 0.001, "exhaustive"


def said():
    state, held = status(), part("preview").held()
    return {
        "message": state.message,
        "notes": state.notes.split("\n"),
        "listed": [item.notes.split("\n") for item in state.bakes],
        "met": held.bake.report["tolerance_met"] if held else None,
        "error": held.bake.report["error"] if held else None,
    }
