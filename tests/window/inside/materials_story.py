"""Chrome, glass and neon under an image and a sun: baked, looked at, the neon dimmed and coloured.

A Cycles render of the same camera stands beside the window's pictures.
"""

from math import radians
from pathlib import Path

import bpy
import numpy as np
from hand import FOLDER, Until
from relight_story import install, on_meshes, part, settled, status
from rooms import press, put, to_panel


def story(hand, report):
    yield from install(report)
    bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=False)
    yield 0.5
    build()
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "materials.blend"))
    yield from to_panel(hand)
    hand.view.spaces.active.region_3d.view_perspective = "CAMERA"
    yield 0.5
    yield from press(hand, "prt.bake", status, seconds=400)
    yield Until("the preview has settled", settled, 200)
    report["notes"] = status().notes.splitlines()
    report["said"] = status().message
    report["baked"] = brightness()
    hand.view.spaces.active.shading.type = "MATERIAL"
    yield 12.0  # shaders are compiled by the processor here
    hand.picture("materials 1 baked")
    hand.view.spaces.active.shading.type = "SOLID"
    yield 2.0  # until it is drawn so
    yield from recolour(hand, report)
    hand.picture("materials 3 green neon")
    render(report)


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
    report["recoloured"] = brightness()


def brightness():
    """{object: mean colour} of what is on the meshes."""
    return {name: values.mean(axis=0).tolist() for name, values in on_meshes().items()}


def render(report):
    """What Cycles makes of the file, once the preview is off."""
    bpy.ops.prt.clear()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 48
    scene.cycles.use_denoising = False  # not every build has it
    scene.render.resolution_x, scene.render.resolution_y = 800, 450
    scene.render.filepath = str(FOLDER / "materials_2_cycles.png")
    bpy.ops.render.render(write_still=True)
    report["rendered"] = Path(scene.render.filepath).is_file()


def build():
    """A floor, four balls, a monkey and a neon tube before a wall."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    floor = sheet("floor", 4, 64)
    floor.data.materials.append(checked())
    wall = sheet("wall", 4, 32)
    wall.location, wall.rotation_euler = (0, 2.5, 2), (radians(90), 0, 0)
    wall.data.materials.append(shader("wall", **{"Base Color": (0.35, 0.35, 0.4, 1)}))
    balls = {
        "chrome": {"Base Color": (0.9, 0.9, 0.9, 1), "Metallic": 1.0, "Roughness": 0.05},
        "gold": {"Base Color": (1.0, 0.7, 0.25, 1), "Metallic": 1.0, "Roughness": 0.3},
        "glass": {"Base Color": (0.8, 1.0, 0.9, 1), "Transmission Weight": 1.0, "Roughness": 0.0},
        "lacquer": {"Base Color": (0.6, 0.05, 0.05, 1), "Roughness": 0.2, "Coat Weight": 1.0},
    }
    for k, (name, values) in enumerate(balls.items()):
        bpy.ops.mesh.primitive_uv_sphere_add(
            segments=64, ring_count=32, radius=0.45, location=(1.1 * k - 1.65, 0, 0.45)
        )
        smooth(name, shader(name, **values))
    bpy.ops.mesh.primitive_cylinder_add(vertices=24, radius=0.03, depth=3.6)
    tube = smooth("tube", shader("neon", **{
        "Emission Color": (1.0, 0.1, 0.5, 1), "Emission Strength": 12.0,
        "Base Color": (0, 0, 0, 1),
    }))  # fmt: skip
    tube.location, tube.rotation_euler = (0, 2.2, 1.5), (0, radians(90), 0)
    sun = put("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.data.angle = 2.0, radians(1)
    sun.rotation_euler = radians(45), radians(-20), 0
    camera = put("camera", bpy.data.cameras.new("camera"), (0, -6.5, 2.2))
    camera.rotation_euler, bpy.context.scene.camera = (radians(80), 0, 0), camera
    nodes = bpy.context.scene.world.node_tree.nodes
    sky = nodes.new("ShaderNodeTexEnvironment")
    lights = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    sky.image = bpy.data.images.load(str(lights / "interior.exr"))
    (background,) = (node for node in nodes if node.type == "BACKGROUND")
    bpy.context.scene.world.node_tree.links.new(sky.outputs[0], background.inputs["Color"])
    background.inputs["Strength"].default_value = 0.4


def sheet(name, size, cells):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=cells, y_subdivisions=cells, size=2 * size)
    item = bpy.context.object
    item.name = name
    return item


def smooth(name, material):
    item = bpy.context.object
    item.name = name
    item.data.materials.append(material)
    item.data.polygons.foreach_set("use_smooth", np.ones(len(item.data.polygons), bool))
    return item


def shader(name, **values):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    node = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    for socket, value in values.items():
        node.inputs[socket].default_value = value
    return material


def checked():
    material = shader("checked", Roughness=0.6)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    checker = nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = 8.0
    checker.inputs["Color1"].default_value = 0.5, 0.45, 0.4, 1
    checker.inputs["Color2"].default_value = 0.15, 0.12, 0.1, 1
    principled = next(n for n in nodes if n.type == "BSDF_PRINCIPLED")
    links.new(checker.outputs["Color"], principled.inputs["Base Color"])
    return material
