"""The artist's guide, word by word, from Blender's first scene to the guide's picture."""

import bpy
import numpy as np
from addon import install, part, settled, status
from colours import from_core, largest_difference
from hand import FOLDER, Until
from mathutils import Vector
from pictures import read_picture
from workflow_story import by_mesh, looked_at

TURN = 90


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    yield from build(hand)
    # Blender writes the name into the file dialog's field; no window of ours is in it.
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "first.blend"))
    yield from hand.to_view()
    yield from hand.key("N")
    yield Until("the sidebar is there", lambda: hand.sidebar.width > 100)
    yield 0.5
    hand.sidebar.active_panel_category = "PRT"
    hand.view.tag_redraw()
    yield Until("the cost is there", lambda: part("plan").of(bpy.context.scene)[0] is not None, 60)
    yield 0.5
    yield from light_and_bake(hand, report)
    yield from turn(hand, report)
    scene = bpy.context.scene
    yield from hand.click("prt.look", at=0.5)
    yield Until("materials are shown", lambda: scene.prt.look == "MATERIALS", 5)
    yield Until("the preview has settled", settled)
    yield from looked_at(hand, "guide 3 own materials", seconds=8.0)
    shading = hand.view.spaces.active.shading
    names = ("use_scene_world", "use_scene_lights", "studio_light", "studiolight_rotate_z")
    report["reflects"] = [getattr(shading, name) for name in names]
    report["sun"] = yield from suns(hand)
    report["copies"] = {
        o.name: [m.name for m in o.data.materials]
        for o in scene.objects if o.get("prt_copy")
    }  # fmt: skip
    yield from hand.click("prt.clear", at=0.75)
    yield Until("the preview is off", lambda: not scene.prt.loaded, 10)
    yield 1.0
    report["reflects again"] = [getattr(shading, name) for name in names]
    report["left"] = [m.name for m in bpy.data.materials if "relit" in m.name]


def build(hand):
    """The cube goes; a grid and a monkey come, by the menus' operators and a user's keys."""
    yield from hand.to_view()
    yield from hand.key("DEL")
    yield Until("the cube is gone", lambda: "Cube" not in bpy.data.objects, 5)
    with bpy.context.temp_override(window=hand.window, area=hand.view):
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=60, y_subdivisions=60, size=8)
        bpy.ops.mesh.primitive_monkey_add()
    yield 0.5
    yield from hand.to_view()
    for key in ("G", "Z"):
        yield from hand.key(key)
    yield from hand.type("1")
    yield from hand.key("RET")
    yield from hand.key("TWO", ctrl=True)
    yield 0.5
    with bpy.context.temp_override(window=hand.window, area=hand.view):
        bpy.ops.object.shade_smooth()
    monkey = bpy.context.object
    assert abs(monkey.location.z - 1) < 1e-6 and monkey.modifiers[0].levels == 2
    material = bpy.data.materials.new("Material")
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = 0.745, 0.162, 0.014, 1  # E07020
    shader.inputs["Roughness"].default_value = 0.2
    monkey.data.materials.append(material)
    with bpy.context.temp_override(
        window=hand.window,
        area=hand.view,
        region=next(r for r in hand.view.regions if r.type == "WINDOW"),
    ):
        bpy.ops.view3d.view_selected()
    yield from hand.to_view()
    for _ in range(2):
        yield from hand.key("WHEELDOWNMOUSE")
    hand.view.spaces.active.overlay.show_overlays = False
    # Software OpenGL draws a view eight times after each change otherwise.
    bpy.context.preferences.system.viewport_aa = "OFF"
    yield 0.5


def light_and_bake(hand, report):
    scene = bpy.context.scene
    yield from hand.click("prt.quality", at=0.2)
    yield Until("it is a draft", lambda: scene.prt.quality == "DRAFT", 5)
    yield from hand.click("prt.light", at=0.8)
    yield Until("it is a studio light", lambda: scene.prt.light == "STUDIO", 5)
    yield 1.0
    hand.picture("guide 1 before")
    yield from hand.click("prt.bake")
    yield Until("the bake has begun", lambda: status().running, 10)
    yield Until("the bake is done", lambda: not status().running, 300)
    yield Until("the preview has settled", settled)
    yield from hand.to_view()
    yield 1.0
    hand.picture("guide 2 baked")
    report["said"] = status().message
    report["failed"] = status().failed


def turn(hand, report):
    """The number's field is entered with Return, as when it is double-clicked."""
    x, y = yield from hand.find("prt.rotation", 0.6)
    yield from hand.move(x, y)
    yield from hand.key("RET")
    yield 0.2
    yield from hand.key("A", ctrl=True)
    yield from hand.type(str(TURN))
    yield from hand.key("RET")
    yield 0.3
    yield Until("the preview has settled", settled)
    report["turned"] = float(np.degrees(bpy.context.scene.prt.rotation))
    shown, wanted = by_mesh(), from_core()
    report["difference"] = largest_difference(shown, wanted)
    report["objects"] = sorted(shown)


def suns(hand):
    """How bright the background is where the turned light has its sun, and where it would have it
    were it turned the other way."""
    from prt_core.light import EnvironmentMap

    scene, space = bpy.context.scene, hand.view.spaces.active
    lights = bpy.context.preferences.studio_lights
    (path,) = (each.path for each in lights if each.name == scene.prt.studio)
    pixels = EnvironmentMap.read(path).pixels
    height, width = pixels.shape[:2]
    row, column = np.unravel_index(pixels.sum(axis=2).argmax(), (height, width))
    around, up = np.pi * (1 - 2 * (column + 0.5) / width), np.pi * (0.5 - (row + 0.5) / height)
    kept = space.region_3d.view_rotation.copy()
    space.shading.studiolight_background_alpha = 1.0
    space.show_object_viewport_mesh = False
    space.shading.studiolight_background_blur = 0.0
    brightness = []
    for sign in (1, -1):
        turned = around + sign * scene.prt.rotation
        way = Vector((np.cos(turned) * np.cos(up), np.sin(turned) * np.cos(up), np.sin(up)))
        space.region_3d.view_rotation = way.to_track_quat("-Z", "Y")
        hand.view.tag_redraw()
        yield 3.0
        name = f"guide 4 sun {sign}"
        hand.picture(name)
        seen = read_picture(name)[..., :3]
        across, middle = int(hand.view.x + hand.view.width / 2), hand.view.y + hand.view.height // 2
        brightness.append(float(seen[middle - 20 : middle + 20, across - 20 : across + 20].mean()))
    space.region_3d.view_rotation = kept
    space.shading.studiolight_background_alpha = 0.0
    space.show_object_viewport_mesh = True
    return brightness
