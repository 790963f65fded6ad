"""From the zip to a picture as the guide has it, on Blender's first scene: clicks, and waiting.

Menus and the file dialog are Blender's own and are stepped through by their operators; each entry
that the guide names there counts as a click. What is waited for is timed, the hand is not.
"""

import time

import bpy
from addon import NAME, part, settled, status
from hand import FOLDER, Until
from pictures import SAMPLES, apart, rendered

_TO_DIALOG = ("Edit", "Preferences", "Get Extensions", "⌄", "Install from Disk")


def story(hand, report):
    report["clicks"], report["keys"], report["waited"] = [*_TO_DIALOG], [], {}
    yield 1.0
    yield from installed(hand, report)
    yield from panel(hand, report)
    yield from baked(hand, report)
    hand.view.spaces.active.region_3d.view_perspective = "CAMERA"
    shown = rendered("first 4 ours", "CYCLES", 16)
    bpy.ops.prt.clear()
    report["cycles"] = apart(shown, rendered("first 5 cycles", "CYCLES", SAMPLES))


def waited(report, what, condition, seconds=120):
    start = time.perf_counter()
    yield Until(what, condition, seconds)
    report["waited"][what] = time.perf_counter() - start


def installed(hand, report):
    """The file dialog of *Install from Disk*, the zip in it, and its button."""
    bpy.ops.extensions.package_install_files("INVOKE_DEFAULT", repo="user_default")
    yield Until("the file dialog is there", lambda: dialog() is not None, 10)
    yield 1.0
    window, area = dialog()
    area.spaces.active.params.directory = str(FOLDER).encode()
    yield 1.0
    area.spaces.active.params.filename = "extension.zip"
    yield 0.5
    hand.picture("first 1 dialog")
    report["clicks"] += ["extension.zip", "Install from Disk"]
    for value in ("PRESS", "RELEASE"):
        window.event_simulate("RET", value, x=window.width // 2, y=window.height // 2)
    yield from waited(report, "installed", lambda: NAME in bpy.context.preferences.addons)


def dialog():
    """(window, area) of the file dialog, which may be in the main window."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "FILE_BROWSER":
                return window, area
    return None


def panel(hand, report):
    """`N`, and the tab by a click on it."""
    yield 1.0
    yield from hand.to_view()
    if hand.sidebar.width < 100:
        yield from hand.key("N")
        report["keys"].append("N")
    yield Until("the sidebar is there", lambda: hand.sidebar.width > 100)
    yield 0.5
    region = hand.sidebar
    for down in range(20, region.height, 15):
        yield from hand.move(region.x + region.width - 9, region.y + region.height - down)
        yield from hand.key("LEFTMOUSE")
        if region.active_panel_category == "PRT":
            break
    assert region.active_panel_category == "PRT"
    report["clicks"].append("PRT")
    hand.view.tag_redraw()
    known = part("plan").of
    yield from waited(report, "cost", lambda: known(bpy.context.scene)[0] is not None)
    yield 1.0
    hand.picture("first 2 panel")


def baked(hand, report):
    yield from hand.click("prt.bake")
    report["clicks"].append("Bake")
    start, delays = time.perf_counter(), part("showing").delays
    yield Until("the bake has begun", lambda: status().running, 10)
    while status().running:
        if delays and "first colours" not in report["waited"]:
            report["waited"]["first colours"] = time.perf_counter() - start
        yield 0.02
    yield Until("the preview has settled", settled)
    report["waited"]["baked"] = time.perf_counter() - start
    report["said"], report["failed"] = status().message, status().failed
    yield from hand.to_view()
    yield 1.0
    hand.picture("first 3 baked")
