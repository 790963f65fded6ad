"""A user's first hour: install, bake from the button, stop and go on, and relight by every means.

After each step the colours on the meshes are compared with what the API gives for the same bake,
loaded anew from the disk, under the light as it is then.
"""

import time
from pathlib import Path

import bpy
import numpy as np
from addon import install, part, settled, status
from colours import from_core, means, on_meshes
from hand import FOLDER, Until


def story(hand, report):
    yield from install(report)
    yield from open_scene(hand)
    yield from bake(hand, report)
    yield from stop_and_go_on(hand, report)
    report["light"] = {}
    for step in (drag_rotation, change_world, turn_sun, play_frames, undo, reload_file, restore):
        yield from step(hand, report)


def open_scene(hand):
    """A saved file with a sky and a sun, the panel in the sidebar."""
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "scene.blend"), load_ui=False)
    yield 0.5
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = 2.0, 0.0
    sun.rotation_euler = 0.5, 0.2, 0.0
    bpy.context.scene.collection.objects.link(sun)
    nodes = bpy.context.scene.world.node_tree.nodes
    sky = nodes.new("ShaderNodeTexEnvironment")
    lights = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    sky.image = bpy.data.images.load(str(lights / "city.exr"))
    (background,) = (node for node in nodes if node.type == "BACKGROUND")
    bpy.context.scene.world.node_tree.links.new(sky.outputs[0], background.inputs["Color"])
    bpy.context.scene.prt.resolution = "16"
    bpy.ops.wm.save_mainfile()
    # Software OpenGL draws them longer than all the rest.
    hand.view.spaces.active.overlay.show_overlays = False
    bpy.data.objects["model"].select_set(True)
    yield from hand.to_view()
    yield from hand.key("NUMPAD_PERIOD")
    yield from hand.key("N")
    yield Until("the sidebar is there", lambda: hand.sidebar.width > 100)
    yield 0.5
    hand.sidebar.active_panel_category = "PRT"
    hand.view.tag_redraw()
    yield 0.5


def compare(hand, report, step):
    """Wait for quiet; what differs between the meshes and the API, and how bright they are."""
    yield 0.2
    yield Until(f"the preview has settled ({step})", settled)
    result, wanted = on_meshes(), from_core()
    report["light"][step] = {
        "objects": [sorted(result), sorted(wanted)],
        "difference": max(np.abs(result[name] - wanted[name]).max() for name in wanted),
        "mean": means(result),
        "message": status().message,
        "failed": status().failed,
    }
    hand.picture(step)
    return result


def bake(hand, report):
    report["light"], seen = {}, []
    yield from hand.click("prt.bake")
    yield Until("the bake has begun", lambda: status().running, 10)
    while status().running:
        seen.append((status().stage, round(status().done, 4)))
        if len(seen) == 15:
            hand.picture("baking")
        yield 0.03
    report["progress"] = list(dict.fromkeys(seen))
    report["said"] = status().message
    report["turns"] = sorted(part("work").turns)
    yield from compare(hand, report, "baked")
    report["baked"] = report.pop("light")["baked"]


def stop_and_go_on(hand, report):
    """Esc in the midst of a second bake; the button goes on; the same bytes as without Esc."""
    import prt_core

    scene = bpy.context.scene
    scene.prt.name = "Second"
    yield 0.5
    yield from hand.click("prt.bake")
    yield Until("it is in the midst", lambda: status().running and status().done > 0.2)
    yield from hand.to_view()
    start = time.perf_counter()
    hand.event("ESC", "PRESS")
    while status().running and time.perf_counter() - start < 30:
        yield 0.005
    result = {"seconds_to_stop": time.perf_counter() - start, "said": status().message}
    hand.event("ESC", "RELEASE")
    yield 0.2
    path = FOLDER / "prt" / "Second.prt"
    result["complete_then"] = prt_core.BakeStore(path).attributes["complete"]
    hand.picture("stopped")
    yield from hand.click("prt.bake")
    yield Until("it has begun again", lambda: status().running, 10)
    yield Until("it is done", lambda: not status().running)
    result["said_at_the_end"] = status().message
    yield Until("the preview has settled", settled)
    chosen = part("plan").bake_settings(scene)
    prt_core.bake(None, FOLDER / "whole.prt", **vars(chosen))
    one, two = prt_core.BakeStore(path), prt_core.BakeStore(FOLDER / "whole.prt")
    result["same"] = [
        bool((one.read(name) == two.read(name)).all()) for name in ("visibility", "gather")
    ]
    report["stopped"] = result


def drag_rotation(hand, report):
    before = bpy.context.scene.prt.rotation
    part("live").delays.clear()
    yield from hand.drag("prt.rotation", 150)
    yield from compare(hand, report, "rotation")
    report["turned"] = float(np.degrees(bpy.context.scene.prt.rotation - before))
    report["delays"] = list(part("live").delays)


def change_world(hand, report):
    nodes = bpy.context.scene.world.node_tree.nodes
    (background,) = (node for node in nodes if node.type == "BACKGROUND")
    background.inputs["Strength"].default_value = 0.5
    yield from compare(hand, report, "world")


def turn_sun(hand, report):
    """With the keys of a user: R X 40 Return."""
    bpy.ops.object.select_all(action="DESELECT")
    sun = bpy.data.objects["Sun"]
    sun.select_set(True)
    bpy.context.view_layer.objects.active = sun
    yield from hand.to_view()
    for key in ("R", "X"):
        yield from hand.key(key)
    yield from hand.type("40")
    yield from hand.key("RET")
    yield from compare(hand, report, "sun")


def play_frames(hand, report):
    """A keyframed turn of the sky; ten frames by the space bar."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 60
    scene.frame_set(1)
    yield from hand.click("prt.turntable", at=0.75)
    yield from compare(hand, report, "frame 1")
    frames, means = set(), set()
    yield from hand.to_view()
    yield from hand.key("SPACE")
    yield Until("it plays", lambda: hand.window.screen.is_animation_playing, 5)
    while scene.frame_current <= 10:
        frames.add(scene.frame_current)
        means.add(float(on_meshes()["ground"].mean()))
        yield 0.01
    yield from hand.key("SPACE")
    yield Until("it stands", lambda: not hand.window.screen.is_animation_playing, 5)
    report["played"] = {"frames": sorted(frames), "colours": len(means)}
    yield from compare(hand, report, "played")


def undo(hand, report):
    """The sun turned once more, and back by Ctrl Z."""
    yield from hand.to_view()
    for key in ("R", "Y"):
        yield from hand.key(key)
    yield from hand.type("50")
    yield from hand.key("RET")
    yield from compare(hand, report, "turned again")
    yield from hand.key("Z", ctrl=True)
    yield from compare(hand, report, "undone")
    yield from hand.key("Z", ctrl=True, shift=True)
    yield from compare(hand, report, "redone")


def reload_file(hand, report):
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.revert_mainfile()
    yield 0.5
    yield from compare(hand, report, "reloaded")


def restore(hand, report):
    yield from hand.click("prt.clear", at=0.75)
    yield Until("the preview is off", lambda: not bpy.context.scene.prt.loaded, 10)
    yield 0.5
    report["left"] = sorted(on_meshes())
    hand.picture("restored")
