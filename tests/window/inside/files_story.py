"""Two files in one folder; a bake that is not of the scene; undo of a bake."""

import shutil

import bpy
import numpy as np
from addon import install, part, settled, status
from colours import on_meshes
from hand import FOLDER, Until
from rooms import floor_with, press, to_panel


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    floor_with("subdivided")
    bpy.data.objects["fine"].modifiers.clear()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "v01.blend"))
    yield from to_panel(hand)
    hand.picture("files 0 panel")
    bpy.ops.ed.undo_push(message="before the bake")
    yield from press(hand, "prt.bake", status)
    yield Until("the preview has settled", settled)
    report["baked"] = seen(hand)
    hand.picture("files 1 baked")
    yield from undo(hand, report)
    bpy.ops.wm.save_mainfile()
    first = on_meshes()
    yield from second_file(hand, report)
    yield from opened(hand, "v01")
    report["opened"] = seen(hand)
    again = on_meshes()
    report["same"] = bool(all((first[name] == again[name]).all() for name in first))
    hand.picture("files 4 first again")
    yield from opened(hand, "v02")
    report["second again"] = seen(hand)
    # As when both wrote prt/Scene.prt over each other:
    shutil.rmtree(FOLDER / "prt" / "v01_Scene.prt")
    shutil.copytree(FOLDER / "prt" / "v02_Scene.prt", FOLDER / "prt" / "v01_Scene.prt")
    yield from opened(hand, "v01")
    report["of another"] = seen(hand)
    hand.picture("files 5 bake of another")
    yield from press(hand, "prt.clear", status, at=0.75)
    report["restored"] = seen(hand)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 1.0
    yield from to_panel(hand)
    report["new"] = seen(hand)
    hand.picture("files 6 new file")


def undo(hand, report):
    yield from hand.to_view()
    yield from hand.key("Z", ctrl=True)
    yield 1.0
    report["undone"] = seen(hand)
    hand.picture("files 2 undone")
    yield from hand.to_view()
    yield from hand.key("Z", ctrl=True, shift=True)
    yield 0.3
    yield Until("the preview has settled", settled)
    yield 0.3
    report["redone"] = seen(hand)


def second_file(hand, report):
    """Saved under another name; the cube moved by G X .8 Return; baked."""
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "v02.blend"))
    report["saved as"] = seen(hand)
    item = bpy.data.objects["fine"]
    bpy.ops.object.select_all(action="DESELECT")
    item.select_set(True)
    bpy.context.view_layer.objects.active = item
    yield from hand.to_view()
    for key in ("G", "X"):
        yield from hand.key(key)
    yield from hand.type(".8")
    yield from hand.key("RET")
    yield 1.0
    yield Until("the change is noticed", lambda: part("preview").held().warned, 20)
    report["moved"] = seen(hand)
    hand.picture("files 3 moved")
    yield from press(hand, "prt.bake", status)
    yield Until("the preview has settled", settled)
    report["second"] = seen(hand)
    bpy.ops.wm.save_mainfile()


def opened(hand, name):
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / f"{name}.blend"), load_ui=False)
    yield 1.0
    yield Until("the preview has settled", settled)
    yield 0.5


def seen(hand):
    scene, held = bpy.context.scene, part("preview").held()
    shading = hand.view.spaces.active.shading
    state = status()
    return {
        "loaded": scene.prt.loaded,
        "message": state.message,
        "warned": held.warned if held else "",
        "view": [shading.color_type, shading.light],
        "coloured": sorted(on_meshes()),
        "finite": bool(all(np.isfinite(c).all() for c in on_meshes().values())),
        "selected": state.bakes[state.active_bake].name if len(state.bakes) else "",
    }
