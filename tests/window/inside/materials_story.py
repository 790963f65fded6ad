"""Chrome, glass and neon under an image and a sun: baked, looked at, the neon dimmed and coloured.

What was baked is held beside Cycles' own render of the scene, object by object.
"""

import bpy
from addon import install, part, settled, status
from colours import means, on_meshes
from hand import FOLDER, Until
from pictures import SAMPLES, apart, objects_in_blocks, rendered
from rooms import press, to_panel
from workflow_scenes import six_materials


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    six_materials()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "materials.blend"))
    yield from to_panel(hand)
    hand.view.spaces.active.region_3d.view_perspective = "CAMERA"
    bpy.context.scene.prt.quality = "DRAFT"
    yield 0.5
    yield from press(hand, "prt.bake", status, seconds=400)
    yield Until("the preview has settled", settled, 200)
    report["notes"] = status().notes.splitlines()
    report["said"] = status().message
    report["baked"] = means(on_meshes())
    shown = rendered("materials 1 as cycles shows it", "CYCLES", 16)
    hand.view.spaces.active.shading.type = "MATERIAL"
    yield 12.0  # shaders are compiled by the processor here
    hand.picture("materials 2 baked")
    hand.view.spaces.active.shading.type = "SOLID"
    yield 2.0  # until it is drawn so
    yield from recolour(hand, report)
    hand.picture("materials 3 green neon")
    beside_cycles(report, shown)


def recolour(hand, report):
    """As its controls in the panel do: another colour, then brighter."""
    (neon,) = (item for item in bpy.context.scene.prt.emitters if item.name == "neon")
    report["delays"] = []
    for name, value in (("recolour", True), ("colour", (0.1, 1.0, 0.2)), ("strength", 3.0)):
        part("live").delays.clear()
        setattr(neon, name, value)
        hand.view.tag_redraw()
        yield Until(f"the colours follow {name}", settled)
        yield 0.5
        report["delays"].append(list(part("live").delays))
    report["recoloured"] = means(on_meshes())


def beside_cycles(report, shown):
    """How far what was shown is from what Cycles makes of the file, once the preview is off."""
    bpy.ops.prt.clear()
    own = rendered("materials 4 cycles", "CYCLES", SAMPLES)
    report["cycles"] = {
        name: apart(shown, own, part) for name, part in objects_in_blocks().items() if part.any()
    }
