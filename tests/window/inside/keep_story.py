"""Colours are kept, the preview is taken off, and the scene is baked again."""

import bpy
from addon import install, part, settled, status
from colours import attribute_of
from hand import FOLDER, Until
from rooms import confirm, floor_with, press, to_panel


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    floor_with("shared", "instanced", "linked", "subdivided")
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "kept.blend"))
    yield from to_panel(hand)
    yield from press(hand, "prt.bake", status)
    yield Until("the preview has settled", settled)
    hand.picture("kept 1 baked")
    wanted = {o["prt_copy"]: attribute_of(o, "PRT") for o in objects() if o.get("prt_copy")}
    report["baked objects"] = [baked_objects()]
    yield from confirm(hand, "prt.keep", status)
    report["said"] = status().message
    report["kept"] = seen(wanted)
    hand.picture("kept 2 kept")
    yield from press(hand, "prt.clear", status, at=0.75)
    report["restored"] = seen(wanted)
    report["left"] = [o.name for o in objects() if o.get("prt_copy")]
    hand.view.spaces.active.shading.type = "MATERIAL"
    yield 12.0  # shaders are compiled by the processor here
    hand.picture("kept 3 restored, material preview")
    hand.view.spaces.active.shading.type = "SOLID"
    yield from hand.to_view()
    yield from hand.key("Z", ctrl=True)
    yield Until("the preview is back", settled)
    yield 0.5
    report["undone"] = seen(wanted)
    hand.picture("kept 4 restore undone")
    yield from hand.to_view()
    yield from hand.key("Z", ctrl=True, shift=True)
    yield 0.5
    bpy.data.objects["floor"].location.z -= 0.05
    yield from press(hand, "prt.bake", status)
    yield Until("the preview has settled", settled)
    report["baked objects"].append(baked_objects())
    report["baked again"] = seen(wanted)
    hand.picture("kept 5 baked again")
    yield from press(hand, "prt.clear", status, at=0.75)
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.revert_mainfile()
    yield 1.0
    report["reloaded"] = seen(wanted)
    hand.picture("kept 6 reloaded")


def objects():
    return bpy.context.scene.objects


def baked_objects():
    """Names and corners: hidden points depend on how near the floor is to what stands on it."""
    return sorted([item.name, len(item.corner_point)] for item in part("preview").held().items)


def seen(wanted):
    """Of what was kept: whether it is right and seen; of all: what is seen and what renders."""
    kept = {o["prt_kept"]: o for o in objects() if o.get("prt_kept")}
    return {
        "same": {n: bool((attribute_of(o, "Relit") == wanted[n]).all()) for n, o in kept.items()},
        "kept visible": [o.visible_get() for o in kept.values()],
        "kept renders": [not o.hide_render for o in kept.values()],
        "originals visible": originals(lambda o: o.visible_get()),
        "originals render": originals(lambda o: not o.hide_render),
        "materials": sorted({o.data.materials[0].name for o in kept.values()}),
    }


def originals(ask):
    names = ("left", "right", "group", "linked", "fine")
    return [bool(ask(next(o for o in objects() if o.name == name))) for name in names]
