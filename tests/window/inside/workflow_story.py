"""Workflows of an artist's day, each from an empty window to a picture, by clicks and keys.

A story is a function here: `play.py -- workflow_story:armature`. Each ends with the colours of the
meshes beside what the core makes of the bake, and most with a picture by Cycles of the scene as it
was beside one of the scene as it is shown.
"""

import time

import bpy
import numpy as np
import workflow_scenes as scenes
from addon import install, part, settled, status
from colours import from_core, largest_difference, means, on_meshes, viewpoint
from hand import FOLDER, Until
from pictures import SAMPLES, apart, eevee, read_picture, rendered
from rooms import press, to_panel


def begin(hand, report, build, draft=True):
    """The zip installed, a new file with a scene in it, saved; the panel, through the camera."""
    began = time.monotonic()
    yield from install(report)
    report["install"] = time.monotonic() - began - 0.5
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    build()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / f"{build.__name__}.blend"))
    yield from to_panel(hand)
    hand.view.spaces.active.region_3d.view_perspective = "CAMERA"
    report["core"], report["said"] = {}, {}
    yield 0.5
    # Buttons move when the panel knows what the bake will cost.
    yield Until("the cost is there", known, 60)
    yield 0.5
    if draft:
        yield from hand.click("prt.quality", at=0.2)
        yield Until("it is a draft", lambda: bpy.context.scene.prt.quality == "DRAFT", 5)
        began = time.monotonic()
        while time.monotonic() - began < 1 or not (known() or time.monotonic() - began > 15):
            yield 0.1
        yield 0.5


def known():
    """Whether the panel shows what a bake of the scene as it is will cost."""
    planned, holds = part("plan").of(bpy.context.scene)
    return planned is not None and holds


def bake(hand, report, name, colours=from_core):
    """The button, a picture of what it brings, and the colours beside the core's."""
    began = time.monotonic()
    yield from press(hand, "prt.bake", status, seconds=300)
    report["bake"] = time.monotonic() - began
    yield from compare(hand, report, name, colours)


def compare(hand, report, name, colours=from_core):
    """A picture once all is quiet; what differs from the core, and what the panel says."""
    yield 0.3
    yield Until("the preview has settled", settled, 120)
    yield from hand.to_view()
    yield 1.5
    hand.picture(name)
    shown, wanted = by_mesh(), colours()
    report["core"][name] = {
        "same objects": sorted(shown) == sorted(wanted),
        "difference": largest_difference(shown, wanted),
        "mean": means(shown),
    }
    held = part("preview").held()
    report["said"][name] = {
        "message": status().message, "failed": status().failed, "warned": held.warned,
        "notes": status().notes.splitlines(), "burnt": held.burnt,
    }  # fmt: skip


def by_mesh():
    """What is on the meshes, by the names that these have in the bake."""
    named = {o.name: o.get("prt_copy") or o.name for o in bpy.context.scene.objects}
    return {named[name]: values for name, values in on_meshes().items()}


def looked_at(hand, name, shading="MATERIAL", seconds=4.0):
    """A picture in another shading mode; shaders are compiled by the processor here."""
    hand.view.spaces.active.shading.type = shading
    yield from hand.to_view()
    yield seconds
    yield Until("shaders are compiled", lambda: not compiling(), 60)
    for _ in range(4):
        hand.view.tag_redraw()
        yield 1.0
    hand.picture(name)


def compiling():
    return bpy.app.is_job_running("SHADER_COMPILATION")


def beside_cycles(hand, report, name):
    """A render of what is shown, then Restore and Cycles' own; how far they are apart."""
    shown = rendered(f"{name} ours", "CYCLES", 16)
    yield from press(hand, "prt.clear", status, at=0.75)
    own = rendered(f"{name} cycles", "CYCLES", SAMPLES)
    report["cycles"] = apart(shown, own)


def default_cube(hand, report):
    """Install, N, the tab, Bake: the clicks of a first picture, on Blender's own first scene."""
    yield from begin(hand, report, scenes.default_cube, draft=False)
    yield from bake(hand, report, "cube 1 baked")
    yield from looked_at(hand, "cube 2 material preview")
    yield from beside_cycles(hand, report, "cube 3")


def textured_asset(hand, report):
    yield from begin(hand, report, scenes.textured_asset)
    yield from bake(hand, report, "textured 1 baked")
    yield from hand.click("prt.look", at=0.5)
    yield Until("materials are shown", lambda: bpy.context.scene.prt.look == "MATERIALS", 5)
    yield Until("the preview has settled", settled)
    yield from looked_at(hand, "textured 2 own materials")
    bpy.context.scene.prt.look = "COLOURS"
    yield 0.3
    yield Until("the preview has settled", settled)
    yield from beside_cycles(hand, report, "textured 3")


def six_materials(hand, report):
    """With gloss by its checkbox, seen from the camera."""
    yield from begin(hand, report, scenes.six_materials)
    yield from hand.click("prt.gloss", at=0.6)
    yield Until("gloss is asked for", lambda: bpy.context.scene.prt.gloss, 5)
    yield 0.5
    yield from press(hand, "prt.bake", status, seconds=300)
    yield Until("the preview has settled", settled, 120)
    yield from hand.click("prt.seen_from", at=0.85)
    yield Until("it is the camera", lambda: bpy.context.scene.prt.seen_from == "CAMERA", 10)
    yield from compare(hand, report, "six 1 baked", lambda: from_core(viewpoint()))
    yield from looked_at(hand, "six 2 material preview")
    yield from beside_cycles(hand, report, "six 3")


def shared_meshes(hand, report):
    yield from of_copies(hand, report, scenes.shared_meshes, "shared")


def instances(hand, report):
    yield from of_copies(hand, report, scenes.instances, "instances")


def linked_library(hand, report):
    yield from of_copies(hand, report, scenes.linked_library, "linked")


def of_copies(hand, report, build, name):
    """What has no mesh of its own is shown by copies, in both looks, and they go with Restore."""
    yield from begin(hand, report, build)
    before = visible()
    yield from bake(hand, report, f"{name} 1 baked")
    yield from hand.click("prt.look", at=0.5)
    yield Until("materials are shown", lambda: bpy.context.scene.prt.look == "MATERIALS", 5)
    yield Until("the preview has settled", settled)
    yield from looked_at(hand, f"{name} 2 own materials")
    own = rendered(f"{name} 3 own materials", eevee(), 16)
    bpy.context.scene.prt.look = "COLOURS"
    hand.view.spaces.active.shading.type = "SOLID"
    yield 0.3
    yield Until("the preview has settled", settled)
    yield from beside_cycles(hand, report, f"{name} 4")
    report["own materials"] = apart(own, read_picture(f"{name} 4 cycles", ".exr"))
    report["as before"] = visible() == before


def visible():
    return sorted((o.name_full, o.visible_get(), o.hide_render) for o in bpy.context.scene.objects)


def armature(hand, report):
    """A skinned arm: baked bent; bent otherwise it is said, and baked again."""
    yield from of_copies(hand, report, scenes.armature, "armature")
    yield from press(hand, "prt.bake", status)
    yield from compare(hand, report, "armature 5 again")
    scenes.bend(-40)
    yield Until("the change is noticed", lambda: part("preview").held().warned, 20)
    report["warned"] = part("preview").held().warned
    hand.picture("armature 6 bent")
    yield from bake(hand, report, "armature 7 baked bent")


def room(hand, report):
    yield from begin(hand, report, scenes.room, draft=False)
    yield from bake(hand, report, "room 1 baked")
    yield from looked_at(hand, "room 2 material preview")
    yield from beside_cycles(hand, report, "room 3")


def animated_sun(hand, report):
    """The space bar plays the day; the shadow goes round."""
    yield from begin(hand, report, scenes.animated_sun)
    yield from bake(hand, report, "sun 1 baked")
    scene, means = bpy.context.scene, set()
    for frame in (8, 16):
        scene.frame_set(frame)
        yield from compare(hand, report, f"sun {2 + frame // 16} frame {frame}")
    scene.frame_set(1)
    yield from hand.to_view()
    yield from hand.key("SPACE")
    yield Until("it plays", lambda: hand.window.screen.is_animation_playing, 5)
    began = time.monotonic()
    while time.monotonic() - began < 10 and len(means) < 12:
        means.add(float(on_meshes()["floor"].mean()))
        yield 0.02
    yield from hand.key("SPACE")
    yield Until("it stands", lambda: not hand.window.screen.is_animation_playing, 5)
    report["played"] = len(means)
    scene.frame_set(16)
    yield 0.3
    yield Until("the preview has settled", settled)
    yield from beside_cycles(hand, report, "sun 4")


def gltf(hand, report):
    """Out by the panel's button and the file dialog, and back by Blender's importer."""
    yield from begin(hand, report, scenes.textured_asset)
    yield from bake(hand, report, "gltf 1 baked")
    wanted = on_meshes()
    yield from hand.click("prt.export_glb")
    yield Until("the file dialog is there", lambda: dialog() is not None, 10)
    yield 1.5
    hand.picture("gltf 2 dialog")
    window = dialog()
    # Both at once: the key closes the dialog, and with it the window that it may have of its own.
    for value in ("PRESS", "RELEASE"):
        window.event_simulate("RET", value, x=window.width // 2, y=window.height // 2)
    yield Until("it is written", lambda: list(FOLDER.glob("*.glb")) and not status().running, 60)
    (path,) = FOLDER.glob("*.glb")
    report["said"]["glb"] = status().message
    yield from press(hand, "prt.clear", status, at=0.75)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    scenes.empty()
    bpy.ops.import_scene.gltf(filepath=str(path))
    report["back"] = back(wanted)
    scenes.camera((2.5, -4.2, 2.6), (68, 0, 30))
    yield from hand.to_view()
    hand.view.spaces.active.region_3d.view_perspective = "CAMERA"
    hand.view.spaces.active.overlay.show_overlays = False
    yield from looked_at(hand, "gltf 3 back")


def dialog():
    """The window of the file dialog, which may be the main one."""
    for window in bpy.context.window_manager.windows:
        if any(area.type == "FILE_BROWSER" for area in window.screen.areas):
            return window
    return None


def back(wanted):
    """The means of what came back, beside those that went out."""
    result = {}
    for item in bpy.context.scene.objects:
        if item.type == "MESH":
            layers = [a.name for a in item.data.attributes]
            radiance = item.data.attributes.get("_PRT_RADIANCE")
            values = np.empty(3 * len(radiance.data), np.float32)
            radiance.data.foreach_get("vector", values)
            result[item.name] = {
                "layers": layers, "largest": float(values.max()),
                "colours": [a.name for a in item.data.color_attributes],
            }  # fmt: skip
    for name, values in wanted.items():
        result.setdefault(name, {})["went out"] = float(values.max())
    return result


def keep(hand, report):
    """Kept by the dialog, the preview off, rendered by EEVEE and Cycles beside Cycles' own."""
    yield from begin(hand, report, scenes.textured_asset)
    own = rendered("keep 1 cycles' own", "CYCLES", SAMPLES)
    bpy.context.scene.render.engine = "CYCLES"
    yield from bake(hand, report, "keep 2 baked")
    bpy.ops.prt.keep("INVOKE_DEFAULT", show=True)
    yield 1.0
    hand.picture("keep 3 dialog")
    yield from hand.key("RET")
    yield Until("colours are kept", lambda: status().message.startswith("'Relit' kept"), 60)
    report["said"]["kept"] = {"message": status().message, "notes": status().notes.splitlines()}
    hand.picture("keep 4 kept")
    yield from press(hand, "prt.clear", status, at=0.75)
    report["active"] = {
        o.name: o.data.color_attributes[o.data.color_attributes.render_color_index].name
        for o in bpy.context.scene.objects if o.type == "MESH"
    }  # fmt: skip
    report["engines"] = {}
    for name, engine in (("eevee", eevee()), ("cycles", "CYCLES")):
        report["engines"][name] = apart(rendered(f"keep 5 {name}", engine, 16), own)
    yield from looked_at(hand, "keep 6 material preview")
