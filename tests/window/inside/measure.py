"""How the window feels: steps of a bake, Esc, slider to colours; figures into report.json.

The scene is scene.blend; headless.json holds the seconds of the same bake without a window.
"""

import json
import time

import bpy
from addon import install, part, settled, status
from hand import FOLDER, Until

CASTERS, TURNS, STOPS = ("embree",), 24, 5


def story(hand, report):
    start = time.perf_counter()
    yield from install(report)
    report["install"] = time.perf_counter() - start - 0.5
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "scene.blend"), load_ui=False)
    # Software OpenGL draws a view eight times after each change otherwise, on the same cores.
    bpy.context.preferences.system.viewport_aa = "OFF"
    yield 0.5
    yield from hand.to_view()
    yield from hand.key("N")
    yield Until("the sidebar is there", lambda: hand.sidebar.width > 100)
    hand.sidebar.active_panel_category = "PRT"
    hand.view.spaces.active.region_3d.view_perspective = "CAMERA"
    hand.view.tag_redraw()
    yield 1.0
    report["bake"] = {}
    for caster in CASTERS:
        yield from bake(hand, report["bake"], caster)
    yield from stops(hand, report)
    scene = bpy.context.scene
    scene.prt.name, scene.prt.caster = "embree", "embree"
    bpy.ops.prt.load("INVOKE_DEFAULT", filepath=str(FOLDER / "prt" / "embree.prt"))
    yield Until("it is loaded", lambda: not status().running)
    # An image of 1024 x 512, not a world of one colour.
    scene.prt.light, scene.prt.studio = "STUDIO", "city.exr"
    yield 1.0
    report["delays"] = yield from slider(hand)
    hand.picture("measured")
    bpy.ops.prt.compress("INVOKE_DEFAULT", confirmed=True)
    yield Until("it is compressed", lambda: not status().running, 300)
    report["quick"] = yield from slider(hand)
    report["points"] = part("preview").held(scene).bake.transport.n_points


def bake(hand, report, caster):
    scene = bpy.context.scene
    scene.prt.caster = caster
    scene.prt.name = caster
    yield 0.5
    yield Until("all is quiet", settled)
    yield from hand.click("prt.bake")
    yield Until("the bake has begun", lambda: status().running, 20)
    start = time.perf_counter()
    yield Until("it is done", lambda: not status().running, 900)
    result = {"seconds": time.perf_counter() - start, "turns": sorted(part("work").turns)}
    result["said"] = status().message
    path = FOLDER / "prt" / f"{caster}.prt" / "zarr.json"
    result["stages"] = sum(json.loads(path.read_text())["attributes"]["seconds"].values())
    yield Until("the preview has settled", settled)
    report[caster] = result


def stops(hand, report):
    """Esc at different moments of a bake; seconds until it has stopped."""
    scene, report["stops"] = bpy.context.scene, []
    for turn in range(STOPS):
        scene.prt.name, scene.prt.caster = f"stop{turn}", CASTERS[turn % len(CASTERS)]
        yield 0.3
        yield from hand.click("prt.bake")
        yield Until("it is in the midst", lambda: status().stage == "visibility", 60)
        yield 0.7 + 0.37 * turn
        yield from hand.to_view()
        start = time.perf_counter()
        hand.event("ESC", "PRESS")
        yield Until("it has stopped", lambda: not status().running, 60)
        report["stops"].append(time.perf_counter() - start)
        hand.event("ESC", "RELEASE")
        yield 0.3


def slider(hand):
    """Seconds from a new rotation to its colours, and to the first picture that has them."""
    scene, live = bpy.context.scene, part("live")
    yield Until("the preview has settled", settled)
    drawn, written, preview = [], [], part("preview")
    write = preview.write

    def timed(*arguments):
        write(*arguments)
        written.append(time.perf_counter())

    preview.write = timed
    handler = bpy.types.SpaceView3D.draw_handler_add(
        lambda: drawn.append(time.perf_counter()), (), "WINDOW", "POST_PIXEL"
    )
    delays = []
    for turn in range(TURNS):
        count, start = len(written), time.perf_counter()
        scene.prt.rotation = 0.25 * (turn + 1)
        yield Until(
            "the colours are drawn",
            lambda count=count: len(written) > count and drawn and drawn[-1] > written[count],
        )
        shown = next(moment for moment in drawn if moment > written[count])
        delays.append((written[count] - start, shown - start))
        yield Until("the preview has settled", live.idle)
        yield 0.3
    preview.write = write
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    return delays
