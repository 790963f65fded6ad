"""An artist's first picture, and the height of the panel in a window of 1920 x 1080.

The scene has a white floor under a hard sun, a textured monkey, a golden ball and an HDRI.
"""

import time
from pathlib import Path

import bpy
from addon import install, part, settled, status
from hand import FOLDER, Until
from pictures import read_picture


def story(hand, report):
    yield from install(report)
    yield from build(hand, report)
    hand.picture("before")
    report["height"] = yield from height(hand)
    began = time.monotonic()
    yield from hand.click("prt.bake")
    yield Until("the bake has begun", lambda: status().running, 10)
    yield Until("the bake is done", lambda: not status().running, 300)
    report["seconds_to_picture"] = time.monotonic() - began
    hand.picture("baked")
    yield Until("the preview has settled", settled)
    report["said"] = status().message
    report["solid"] = yield from seen(hand, "solid", "SOLID")
    report["material"] = yield from seen(hand, "material preview", "MATERIAL")
    # Each notch of the wheel draws the view, which takes seconds where its shaders run by software.
    hand.view.spaces.active.shading.type = "SOLID"
    report["height_baked"] = yield from height(hand)
    yield from while_baking(hand, report)
    yield from own_materials(hand, report)


def while_baking(hand, report):
    """The height during a bake that takes longer than looking does."""
    scene = bpy.context.scene
    before = {name: getattr(scene.prt, name) for name in ("name", "quality")}
    scene.prt.name, scene.prt.quality = "Long", "CUSTOM"
    scene.prt.resolution, scene.prt.tolerance = "64", 0.001
    yield 1.0
    yield from hand.click("prt.bake")
    yield Until("the bake has begun", lambda: status().running, 10)
    report["height_baking"] = yield from height(hand)
    report["was_baking"] = status().running
    hand.picture("baking")
    yield from hand.to_view()
    yield from hand.key("ESC")
    yield Until("it has stopped", lambda: not status().running, 60)
    for name, value in before.items():
        setattr(scene.prt, name, value)
    yield Until("the preview has settled", settled, 120)


def build(hand, report):
    bpy.ops.wm.read_homefile(use_empty=True, load_ui=False)
    yield 0.5
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=40, y_subdivisions=40, size=8)
    bpy.context.object.data.materials.append(material("White", (0.85, 0.85, 0.85)))
    bpy.ops.mesh.primitive_monkey_add(location=(-1.2, 0, 1.0))
    monkey = bpy.context.object
    monkey.data.materials.append(checked())
    monkey.modifiers.new("Subdivision", "SUBSURF").levels = 2
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    bpy.ops.object.shade_smooth()
    bpy.ops.mesh.primitive_uv_sphere_add(location=(1.4, 0, 0.9), radius=0.9)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material("Gold", (1.0, 0.7, 0.3), 1.0, 0.15))
    # Objects of several materials are shown by other nodes.
    bpy.context.object.data.materials.append(material("Rim", (0.8, 0.6, 0.3), 1.0, 0.2))
    bpy.context.object.data.polygons[0].material_index = 1
    bpy.ops.object.light_add(type="SUN", rotation=(0.7, 0.3, 0))
    bpy.context.object.data.energy = 4.0
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    nodes = scene.world.node_tree.nodes
    sky = nodes.new("ShaderNodeTexEnvironment")
    lights = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    sky.image = bpy.data.images.load(str(lights / "courtyard.exr"))
    (background,) = (node for node in nodes if node.type == "BACKGROUND")
    scene.world.node_tree.links.new(sky.outputs[0], background.inputs["Color"])
    scene.prt.quality = "DRAFT"
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "look.blend"))
    space = hand.view.spaces.active
    space.overlay.show_overlays = False
    space.shading.use_scene_world = True
    space.shading.use_scene_lights = True
    with bpy.context.temp_override(window=hand.window, area=hand.view):
        bpy.ops.screen.screen_full_area()
    yield 1.0
    yield from hand.to_view()
    bpy.ops.object.select_all(action="SELECT")
    yield from hand.key("NUMPAD_PERIOD")
    bpy.ops.object.select_all(action="DESELECT")
    if not hand.view.spaces.active.show_region_ui:
        yield from hand.key("N")
    yield Until("the sidebar is there", lambda: hand.sidebar.width > 100)
    yield 0.5
    hand.sidebar.active_panel_category = "PRT"
    hand.view.tag_redraw()
    began = time.monotonic()
    while part("plan").of(scene)[0] is None and time.monotonic() - began < 120:
        yield 0.2
    report["seconds_to_cost"] = time.monotonic() - began
    yield 1.0


def material(name, colour, metallic=0.0, roughness=0.5):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Metallic"].default_value = metallic
    shader.inputs["Roughness"].default_value = roughness
    return made


def checked():
    """A glossy material with a texture finer than the mesh."""
    made = material("Checked", (1, 1, 1), roughness=0.1)
    tree = made.node_tree
    checks = tree.nodes.new("ShaderNodeTexChecker")
    checks.inputs["Scale"].default_value = 24
    checks.inputs["Color1"].default_value = 0.8, 0.1, 0.1, 1
    checks.inputs["Color2"].default_value = 0.9, 0.9, 0.8, 1
    place = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["UV"], checks.inputs["Vector"])
    tree.links.new(checks.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return made


def height(hand):
    """Pixels that the panel is high: as far as it scrolls, and to below the last button there."""
    yield from hand.wheel("WHEELUPMOUSE", 30)
    yield 0.2
    region, lowest, last = hand.sidebar, 0, None
    top = region.view2d.region_to_view(0, 0)[1]
    yield from hand.wheel("WHEELDOWNMOUSE", 60)
    yield 0.2
    scrolled = top - region.view2d.region_to_view(0, 0)[1]
    y = region.y + 4
    while last is None and y < region.y + region.height:
        for at in (0.45, 0.85, 0.2):
            yield from hand.move(region.x + region.width * at, y)
            last = last or hand.under_mouse()
        y += 7
    lowest = scrolled + region.y + region.height - y
    yield from hand.wheel("WHEELUPMOUSE", 30)
    return {
        "panel": lowest, "scrolled": scrolled, "last": last, "region": region.height,
        "window": hand.window.height,
    }  # fmt: skip


def seen(hand, name, shading):
    """The mean colour of the middle of the view in a shading mode, of the window as it is drawn."""
    hand.view.spaces.active.shading.type = shading
    # Shaders are compiled beside, and by software; until then surfaces are plain.
    for _ in range(6):
        hand.view.tag_redraw()
        yield 5.0
    yield Until("the preview has settled", settled)
    hand.picture(name)
    pixels = read_picture(name)[..., :3]
    # The floor and a part of the ball: what is behind them is of each mode its own.
    height, width = pixels.shape[:2]
    part = pixels[int(0.3 * height) : int(0.48 * height), int(0.42 * width) : int(0.57 * width)]
    white = float((part.min(axis=-1) > 0.985).mean())
    return {"mean": part.mean(axis=(0, 1)).tolist(), "white": white}


def own_materials(hand, report):
    scene = bpy.context.scene
    slots = {o.name: [s.material.name for s in o.material_slots] for o in scene.objects}
    scene.prt.look = "MATERIALS"
    report["own"] = yield from seen(hand, "own materials", "MATERIAL")
    bpy.ops.wm.save_mainfile()
    report["slots"] = slots == {
        o.name: [s.material.name for s in o.material_slots] for o in scene.objects
    }
    yield from hand.click("prt.clear", at=0.75)
    yield Until("the preview is off", lambda: not scene.prt.loaded, 10)
    yield 1.0
    report["left"] = [m.name for m in bpy.data.materials if "relit" in m.name]
    report["modifiers"] = [m.name for o in scene.objects for m in o.modifiers]
    hand.picture("restored")
