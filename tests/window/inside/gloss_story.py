"""Gloss by real clicks: a golden monkey on a floor is baked, and its colours follow the view.

The view is orbited by a user's keys; after each step the colours on the meshes are compared with
what the core makes of the bake, loaded anew from the disk, for the view as it is then.
"""

import time
from pathlib import Path

import bpy
import numpy as np
from addon import install, part, settled, status
from colours import from_core, largest_difference, means, on_meshes, viewpoint
from hand import FOLDER, Until
from mathutils import Quaternion
from rooms import mesh_of, press, put, to_panel

TURNS, DEGREES = 16, 6.0


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    build()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "monkey.blend"))
    bpy.context.preferences.system.viewport_aa = "OFF"
    yield from to_panel(hand)
    hand.view.spaces.active.region_3d.view_perspective = "PERSP"
    yield 0.5
    report["steps"] = {}
    for step in (bake, orbit, keep_turning, switch, camera, restore):
        yield from step(hand, report)


def build():
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    put("floor", mesh_of("floor", 2.5, 40), (0, 0, -1))
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    monkey.name = "monkey"
    monkey.modifiers.new("Fine", "SUBSURF").levels = 2
    bpy.ops.object.modifier_apply(modifier="Fine")
    monkey.data.shade_smooth()
    paint("monkey", (1, 0.72, 0.3, 1), Metallic=1.0, Roughness=0.35)
    paint("floor", (0.2, 0.25, 0.35, 1), Metallic=0.0, Roughness=0.3)
    eye = put("eye", bpy.data.cameras.new("eye"), (0, -6, 1.5))
    eye.rotation_euler = 1.4, 0, 0
    scene = bpy.context.scene
    scene.camera = eye
    scene.prt.resolution, scene.prt.tolerance = "16", 0.1
    lights = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    scene.prt.light, scene.prt.file = "FILE", str(lights / "city.exr")


def paint(name, colour, **inputs):
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = colour
    for key, value in inputs.items():
        shader.inputs[key].default_value = value
    bpy.data.objects[name].data.materials.append(material)


def compare(hand, report, step):
    """Wait for quiet; what differs between the meshes and the core."""
    yield 0.5
    yield Until(f"the colours have settled ({step})", settled, 120)
    shown, wanted = on_meshes(), from_core(viewpoint())
    report["steps"][step] = {
        "difference": largest_difference(shown, wanted),
        "mean": means(shown),
        "said": status().message,
        "failed": status().failed,
    }
    yield from hand.to_view()
    yield 1.5
    hand.picture(f"gloss {step}")


def bake(hand, report):
    """Gloss by its checkbox, then the button; before, the preview's switch says why it is grey."""
    report["grey"] = part("preview").no_gloss(part("preview").held())
    yield from hand.click("prt.gloss", at=0.6)
    yield Until("gloss is asked for", lambda: bpy.context.scene.prt.gloss, 10)
    yield from press(hand, "prt.bake", status, seconds=300)
    report["points"] = len(part("preview").held().bake.scene.points)
    yield from compare(hand, report, "baked")


def orbit(hand, report):
    """Numpad keys, a step each, as a user does; the colours are compared where it ends."""
    before = on_meshes()["monkey"]
    yield from hand.to_view()
    for _ in range(3):
        yield from hand.key("NUMPAD_4")
    yield from compare(hand, report, "orbited")
    report["changed"] = float(np.abs(on_meshes()["monkey"] - before).max())


def keep_turning(hand, report):
    """The view turns and turns; how often the colours follow, and that no light is worked out."""
    gloss, region = part("gloss"), hand.view.spaces.active.region_3d
    relighter, lights = part("preview").held().relighter, []
    steps, drawn = relighter.steps, []
    relighter.steps = lambda *a, **k: lights.append(1) or steps(*a, **k)
    handler = bpy.types.SpaceView3D.draw_handler_add(
        lambda: drawn.append(time.perf_counter()), (), "WINDOW", "POST_PIXEL"
    )
    gloss.frames.clear()
    turn, waits, count, start = Quaternion((0, 0, 1), np.radians(DEGREES)), [], 0, time.time()
    for _ in range(TURNS):
        count, begun = gloss.written[0], time.perf_counter()
        region.view_rotation = turn @ region.view_rotation
        yield Until(
            "the colours follow",
            lambda count=count, begun=begun: (
                gloss.written[0] > count and drawn and drawn[-1] > begun
            ),
            60,
        )
        waits.append(time.perf_counter() - begun)
    report["turning"] = {
        "frames": list(gloss.frames), "waits": waits, "seconds": time.time() - start,
    }  # fmt: skip
    # Moves that come faster than colours leave none behind.
    frames = gloss.written[0]
    for _ in range(TURNS):
        region.view_rotation = turn @ region.view_rotation
        yield 0.01
    yield from compare(hand, report, "turned")
    report["turning"]["fast"] = gloss.written[0] - frames
    report["turning"]["lights"] = len(lights)
    del relighter.steps
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")


def switch(hand, report):
    """Gloss off and on by its checkbox under Light."""
    yield from hand.click("prt.show_gloss", at=0.2)
    yield Until("it is off", lambda: not bpy.context.scene.prt.show_gloss, 10)
    yield from compare(hand, report, "off")
    yield from hand.click("prt.show_gloss", at=0.2)
    yield Until("it is on", lambda: bpy.context.scene.prt.show_gloss, 10)
    yield from compare(hand, report, "on")


def camera(hand, report):
    """Seen from the camera by the button for it; the camera is moved by G X 2 Return."""
    yield from hand.click("prt.seen_from", at=0.85)
    yield Until("it is the camera", lambda: bpy.context.scene.prt.seen_from == "CAMERA", 10)
    yield from compare(hand, report, "camera")
    bpy.ops.object.select_all(action="DESELECT")
    eye = bpy.data.objects["eye"]
    eye.select_set(True)
    bpy.context.view_layer.objects.active = eye
    yield from hand.to_view()
    for key in ("G", "X"):
        yield from hand.key(key)
    yield from hand.type("2")
    yield from hand.key("RET")
    yield from compare(hand, report, "camera moved")


def restore(hand, report):
    yield from hand.click("prt.clear", at=0.75)
    yield Until("the preview is off", lambda: not bpy.context.scene.prt.loaded, 10)
    yield 0.5
    report["left"] = sorted(on_meshes())
