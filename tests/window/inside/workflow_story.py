"""Workflows of an artist's day, each from an empty window to a picture, by clicks and keys.

A story is a function here: `play.py -- workflow_story:armature`. Each ends with the colours of the
meshes beside what the core makes of the bake, and most with a picture by Cycles of the scene as it
was beside one of the scene as it is shown.
"""

import time

import bpy
import materials_story
import numpy as np
import workflow_scenes as scenes
from hand import FOLDER, Until
from relight_story import from_api, install, on_meshes, part, settled, status
from rooms import press, to_panel

# Pixels of the pictures beside Cycles, its samples, and of how many pixels a side means are taken:
# its noise is not ours.
_SIZE, _SAMPLES, _BLOCK = (480, 300), 64, 6


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


def bake(hand, report, name, colours=from_api):
    """The button, a picture of what it brings, and the colours beside the core's."""
    began = time.monotonic()
    yield from press(hand, "prt.bake", status, seconds=300)
    report["bake"] = time.monotonic() - began
    yield from compare(hand, report, name, colours)


def compare(hand, report, name, colours=from_api):
    """A picture once all is quiet; what differs from the core, and what the panel says."""
    yield 0.3
    yield Until("the preview has settled", settled, 120)
    yield from hand.to_view()
    yield 1.5
    hand.picture(name)
    shown, wanted = by_mesh(), colours()
    largest = max(values.max() for values in wanted.values())
    report["core"][name] = {
        "same objects": sorted(shown) == sorted(wanted),
        "difference": max(float(np.abs(shown[n] - wanted[n]).max()) for n in wanted) / largest,
        "mean": {n: values.mean(axis=0).tolist() for n, values in shown.items()},
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
    own = rendered(f"{name} cycles", "CYCLES", _SAMPLES)
    report["cycles"] = apart(shown, own)


def apart(one, two):
    """Relative L2, and the ratio of the means by channel, of two pictures where objects are."""
    one, two = (blocks(picture) for picture in (one, two))
    seen = two[..., 3] > 0.999
    one, two = one[seen][:, :3], two[seen][:, :3]
    return {
        "l2": float(np.sqrt(((one - two) ** 2).sum() / (two**2).sum())),
        "ratio": (one.mean(axis=0) / two.mean(axis=0)).tolist(),
        "pixels": int(seen.sum()),
    }


def blocks(picture):
    height, width = (n // _BLOCK * _BLOCK for n in picture.shape[:2])
    cut = picture[:height, :width].reshape(height // _BLOCK, _BLOCK, width // _BLOCK, _BLOCK, 4)
    return cut.mean(axis=(1, 3))


def eevee():
    return "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0) else "BLENDER_EEVEE"


def rendered(name, engine, samples):
    """(height, width, 4) float32, linear, of a render through the camera; and NAME.png of it as
    the display shows it."""
    scene = bpy.context.scene
    scene.render.engine = engine
    if engine == "CYCLES":
        scene.cycles.device, scene.cycles.samples = "CPU", samples
        scene.cycles.use_denoising = False  # not every build has it
        # All bounces, as a bake has them: by itself Cycles ends after four.
        scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 64
        scene.cycles.sample_clamp_indirect = 0
    scene.render.resolution_x, scene.render.resolution_y = _SIZE
    scene.render.resolution_percentage, scene.render.film_transparent = 100, True
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode = "OPEN_EXR", "RGBA"
    path = FOLDER / f"{name.replace(' ', '_')}.exr"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return seen_in(name, scene)


def seen_in(name, scene=None):
    """The pixels of NAME.exr; for a scene NAME.png as well, as its display shows them."""
    path = FOLDER / f"{name.replace(' ', '_')}.exr"
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    if scene is not None:
        scene.render.image_settings.file_format = "PNG"
        image.save_render(str(path.with_suffix(".png")), scene=scene)
    bpy.data.images.remove(image)
    return pixels.reshape(_SIZE[1], _SIZE[0], 4)


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
    yield from begin(hand, report, materials_story.build)
    yield from hand.click("prt.gloss", at=0.6)
    yield Until("gloss is asked for", lambda: bpy.context.scene.prt.gloss, 5)
    yield 0.5
    yield from press(hand, "prt.bake", status, seconds=300)
    yield Until("the preview has settled", settled, 120)
    yield from hand.click("prt.seen_from", at=0.85)
    yield Until("it is the camera", lambda: bpy.context.scene.prt.seen_from == "CAMERA", 10)
    yield from compare(hand, report, "six 1 baked", with_gloss)
    yield from looked_at(hand, "six 2 material preview")
    yield from beside_cycles(hand, report, "six 3")


def with_gloss():
    """The colours by the core, of the bake on the disk, as the camera sees them."""
    import prt_core
    from prt_core.relight.relighter import Relighter

    scene, held = bpy.context.scene, part("preview").held()
    asked = part("request").request(scene)
    loaded = prt_core.load(bpy.path.abspath(scene.prt.loaded))
    relighter = Relighter(loaded, scene.prt.caster)
    try:
        return loaded.colours(relighter.radiance(asked.lighting, view=asked.view_of(held)))
    finally:
        relighter.close()


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
    report["own materials"] = apart(own, seen_in(f"{name} 4 cycles"))
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
    for value in ("PRESS", "RELEASE"):
        window.event_simulate("RET", value, x=window.width // 2, y=window.height // 2)
        yield 0.2
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
    own = rendered("keep 1 cycles' own", "CYCLES", _SAMPLES)
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
