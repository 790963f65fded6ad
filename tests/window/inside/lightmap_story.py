"""A lightmap is baked by its button, and occlusion written into an attribute, both by dialogs."""

import bpy
import numpy as np
from addon import install, settled, status
from hand import FOLDER, Until
from rooms import floor_with, press, to_panel


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    floor_with("shared", "subdivided")
    scene = bpy.context.scene
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "mapped.blend"))
    yield from to_panel(hand)
    blocks = [len(kind) for kind in (bpy.data.scenes, bpy.data.meshes)]
    report["mode"], report["selected"] = [bpy.context.mode], selected(scene)
    bpy.ops.prt.lightmap("INVOKE_DEFAULT", filepath="//map", size=(128, 128), format="PNG16")
    yield 1.0
    hand.picture("map 1 dialog")
    yield from hand.key("RET")
    yield Until("the lightmap is there", lambda: done("Lightmap"), 240.0)
    report["said"] = status().message
    report["mode"].append(bpy.context.mode)
    report["same selection"] = selected(scene) == report.pop("selected")
    report["scenes"] = len(bpy.data.scenes) - blocks[0]
    report["maps"] = {o.name: list(o.data.uv_layers.keys()) for o in scene.objects}
    image = bpy.data.images["map"]
    report["image"] = [image.colorspace_settings.name, *image.size, float(np.mean(image.pixels))]
    hand.picture("map 2 baked")
    yield from press(hand, "prt.bake", status)
    yield Until("the preview has settled", settled)
    bpy.ops.prt.occlusion("INVOKE_DEFAULT", distance=0.5, falloff="linear")
    yield 1.0
    hand.picture("map 3 occlusion dialog")
    yield from hand.key("RET")
    yield Until("the attribute is there", lambda: done("'AO'"), 120.0)
    report["attributes"] = list(scene.objects["floor"].data.color_attributes.keys())
    hand.picture("map 4 occlusion")


def selected(scene):
    return sorted(o.name for o in scene.objects if o.select_get())


def done(text):
    if status().failed:
        raise RuntimeError(status().message)
    return not status().running and status().message.startswith(text)
