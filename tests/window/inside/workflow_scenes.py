"""Scenes of an artist's days, each built as its maker would, from an empty file or Blender's."""

from math import radians
from pathlib import Path

import bpy
import numpy as np
from hand import FOLDER
from rooms import mesh_of, put, shader, smooth

# Of the image that the textured asset wears, texels along a side.
_TEXELS = 256


def empty():
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)


def floor(cells=48, size=3.0, colour=(0.5, 0.5, 0.5, 1)):
    item = put("floor", mesh_of("floor", size, cells))
    item.data.materials.append(shader("floor", **{"Base Color": colour, **MATT}))
    return item


# Without the gloss that every new material has.
MATT = {"Specular IOR Level": 0.0, "Roughness": 1.0}


def sky(name, strength=1.0):
    """One of Blender's images as the world."""
    tree = bpy.context.scene.world.node_tree
    image = tree.nodes.new("ShaderNodeTexEnvironment")
    lights = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    image.image = bpy.data.images.load(str(lights / name))
    (background,) = (node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(image.outputs[0], background.inputs["Color"])
    background.inputs["Strength"].default_value = strength


def sun(strength=3.0, turned=(45, -20, 0), angle=2.0):
    item = put("sun", bpy.data.lights.new("sun", "SUN"))
    item.data.energy, item.data.angle = strength, radians(angle)
    item.rotation_euler = [radians(a) for a in turned]
    return item


def camera(place, turned, lens=50.0):
    item = put("camera", bpy.data.cameras.new("camera"), place)
    item.rotation_euler = [radians(a) for a in turned]
    item.data.lens = lens
    bpy.context.scene.camera = item


def default_cube():
    """Blender's own first scene stays as it is."""


def textured_asset():
    """A crate with an image of planks by its UV map, on a floor, under an image and a sun."""
    empty()
    floor()
    bpy.ops.mesh.primitive_cube_add(size=1.4, location=(0, 0, 0.7), rotation=(0, 0, radians(30)))
    crate = bpy.context.object
    crate.name = "crate"
    bevel = crate.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments = 0.04, 2
    bpy.ops.object.modifier_apply(modifier="Bevel")
    fine = crate.modifiers.new("Fine", "SUBSURF")
    fine.subdivision_type, fine.levels = "SIMPLE", 4
    bpy.ops.object.modifier_apply(modifier="Fine")
    material = shader("planks", **MATT)
    texture = material.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = planks()
    principled = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    material.node_tree.links.new(texture.outputs["Color"], principled.inputs["Base Color"])
    crate.data.materials.append(material)
    sky("courtyard.exr", 0.6)
    sun()
    camera((2.5, -4.2, 2.6), (68, 0, 30))


def planks():
    """An image of four planks, each of its own brown, with dark gaps, saved beside the file."""
    image = bpy.data.images.new("planks", _TEXELS, _TEXELS)
    row = np.arange(_TEXELS)[:, None] / _TEXELS * 4
    tone = np.array([0.55, 0.8, 0.65, 0.95])[row.astype(int) % 4]
    grain = 0.06 * np.sin(np.arange(_TEXELS)[None] * 0.11 + 9 * np.sin(row * 7))
    shade = np.where(row % 1 < 0.06, 0.12, tone + grain)
    pixels = np.ones((_TEXELS, _TEXELS, 4), np.float32)
    pixels[..., :3] = shade[..., None] * (0.75, 0.5, 0.28)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(FOLDER / "planks.png"), "PNG"
    image.save()
    return image


def shared_meshes():
    """Six pillars of one mesh in two rows, one of them mirrored."""
    empty()
    floor()
    bpy.ops.mesh.primitive_cylinder_add(vertices=24, radius=0.25, depth=1.6, location=(0, 0, 0.8))
    first = bpy.context.object
    _cut(first, 8)
    first.name = "pillar"
    first.data.materials.append(shader("stone", **{"Base Color": (0.65, 0.55, 0.4, 1), **MATT}))
    for index in range(6):
        item = first if index == 0 else put(f"pillar {index}", first.data)
        item.location = 1.4 * (index % 3 - 1), 1.2 * (index // 3) - 0.4, 0.8
    item.scale.x = -1
    sky("courtyard.exr", 0.6)
    sun()
    camera((0, -5.5, 2.8), (68, 0, 0))


def _cut(item, levels):
    """Cut the sides of a cylinder across, so that they hold a shadow."""
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.bisect(plane_co=item.location, plane_no=(0, 0, 1))
    for level in range(1, levels):
        bpy.ops.mesh.select_all(action="SELECT")
        height = item.location.z + 0.8 * (level / levels) * (1 if level % 2 else -1)
        bpy.ops.mesh.bisect(plane_co=(0, 0, height), plane_no=(0, 0, 1))
    bpy.ops.object.mode_set(mode="OBJECT")


def instances():
    """A tree as a collection, put into the scene seven times, turned and scaled."""
    empty()
    floor()
    parts = bpy.data.collections.new("tree")
    for name, add, colour in (
        ("trunk", _trunk, (0.3, 0.18, 0.08, 1)), ("crown", _crown, (0.15, 0.4, 0.1, 1)),
    ):  # fmt: skip
        item = add()
        item.name = name
        item.data.materials.append(shader(name, **{"Base Color": colour, **MATT}))
        for collection in list(item.users_collection):
            collection.objects.unlink(item)
        parts.objects.link(item)
    rng = np.random.default_rng(3)
    for index in range(7):
        around = index * 2 * np.pi / 7
        place = 1.8 * np.cos(around), 1.8 * np.sin(around), 0
        group = put(f"tree {index}", None, place)
        group.instance_type, group.instance_collection = "COLLECTION", parts
        group.rotation_euler.z = rng.uniform(0, 6)
        group.scale = [rng.uniform(0.7, 1.2)] * 3
    sky("courtyard.exr", 0.6)
    sun()
    camera((0, -6, 3.4), (64, 0, 0))


def _trunk():
    bpy.ops.mesh.primitive_cylinder_add(vertices=12, radius=0.08, depth=0.7, location=(0, 0, 0.35))
    return bpy.context.object


def _crown():
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4, radius=0.45, location=(0, 0, 1.0))
    bpy.context.object.data.shade_smooth()
    return bpy.context.object


def linked_library():
    """A lamp post and a bench from a library, linked; the bench a second time as a collection."""
    empty()
    ground = floor()
    bpy.ops.mesh.primitive_monkey_add(location=(-0.9, 0, 0.85))
    bust = bpy.context.object
    fine = bust.modifiers.new("Fine", "SUBSURF")
    fine.levels = fine.render_levels = 2
    bust.name = "bust"
    bust.data.shade_smooth()
    bust.data.materials.append(shader("marble", **{"Base Color": (0.8, 0.78, 0.74, 1), **MATT}))
    bpy.ops.mesh.primitive_cube_add(size=0.6, location=(0.9, 0, 0.3))
    plinth = bpy.context.object
    plinth.name = "plinth"
    simple = plinth.modifiers.new("Fine", "SUBSURF")
    simple.subdivision_type, simple.levels, simple.render_levels = "SIMPLE", 4, 4
    plinth.data.materials.append(shader("brick", **{"Base Color": (0.5, 0.16, 0.1, 1), **MATT}))
    library = str(FOLDER / "props.blend")
    bpy.data.libraries.write(library, {bust, plinth}, fake_user=True)
    empty_of = [bust, plinth]
    bpy.data.batch_remove(empty_of)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["bust", "plinth"]
    for item in wanted.objects:
        bpy.context.scene.collection.objects.link(item)
    assert ground.library is None and all(item.library for item in wanted.objects)
    sky("courtyard.exr", 0.6)
    sun()
    camera((0, -5, 2.4), (70, 0, 0))


def armature():
    """An arm of two bones, bent, whose skin follows them."""
    empty()
    floor()
    bpy.ops.mesh.primitive_cylinder_add(vertices=24, radius=0.2, depth=2.0, location=(0, 0, 1.0))
    arm = bpy.context.object
    _cut(arm, 12)
    arm.name = "arm"
    arm.data.shade_smooth()
    arm.data.materials.append(shader("skin", **{"Base Color": (0.7, 0.4, 0.3, 1), **MATT}))
    bpy.ops.object.armature_add()
    rig = bpy.context.object
    rig.name = "rig"
    bpy.ops.object.mode_set(mode="EDIT")
    bones = rig.data.edit_bones
    bones[0].head, bones[0].tail = (0, 0, 0), (0, 0, 1)
    upper = bones.new("upper")
    upper.head, upper.tail, upper.parent = (0, 0, 1), (0, 0, 2), bones[0]
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.object.select_all(action="DESELECT")
    arm.select_set(True)
    rig.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    bend(60)
    sky("courtyard.exr", 0.6)
    sun()
    camera((1.0, -5, 2.2), (72, 0, 10))


def bend(degrees):
    """Bend the arm at its elbow."""
    bone = bpy.data.objects["rig"].pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    bone.rotation_euler.z = radians(degrees)
    bpy.context.view_layer.update()


def room():
    """A closed room with a window, through which the sky and the sun come in; a ball in it."""
    empty()
    wall = shader("wall", **{"Base Color": (0.75, 0.72, 0.68, 1), **MATT})
    red = shader("red", **{"Base Color": (0.6, 0.08, 0.06, 1), **MATT})
    # Walls have two sides and a thickness, as rooms of architects have.
    for name, size, place, colour in (
        ("ground", (4.4, 4.4, 0.2), (0, 0, -0.1), wall),
        ("ceiling", (4.4, 4.4, 0.2), (0, 0, 2.6), wall),
        ("back", (4.4, 0.2, 2.5), (0, 2.1, 1.25), wall),
        ("front", (4.4, 0.2, 2.5), (0, -2.1, 1.25), wall),
        ("right", (0.2, 4.0, 2.5), (2.1, 0, 1.25), red),
        ("sill", (0.2, 4.0, 0.9), (-2.1, 0, 0.45), wall),
        ("lintel", (0.2, 4.0, 0.5), (-2.1, 0, 2.25), wall),
        ("pier", (0.2, 1.2, 1.1), (-2.1, 1.4, 1.45), wall),
        ("pier 2", (0.2, 1.2, 1.1), (-2.1, -1.4, 1.45), wall),
    ):
        box(name, size, place, colour)
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=48, ring_count=24, radius=0.5, location=(0.4, 0.5, 0.5)
    )
    smooth("ball", shader("clay", **{"Base Color": (0.7, 0.6, 0.5, 1), **MATT}))
    sky("courtyard.exr", 1.0)
    sun(8.0, (0, -55, 0))
    camera((1.2, -1.8, 1.5), (78, 0, 18), lens=20.0)


def box(name, size, place, material, step=0.12):
    """A box whose sides are cut into squares about so large."""
    mesh = bpy.data.meshes.new(name)
    corners, faces = [], []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        nu, nv = (max(1, round(size[a] / step)) for a in (u, v))
        for side in (-1, 1):
            first = len(corners)
            for j in range(nv + 1):
                for i in range(nu + 1):
                    point = [0.0, 0.0, 0.0]
                    point[axis] = side * size[axis] / 2
                    point[u], point[v] = size[u] * (i / nu - 0.5), size[v] * (j / nv - 0.5)
                    corners.append(point)
            for j in range(nv):
                for i in range(nu):
                    k = first + j * (nu + 1) + i
                    face = [k, k + 1, k + nu + 2, k + nu + 1]
                    faces.append(face if side > 0 else face[::-1])
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    return put(name, mesh, place)


def six_materials():
    """A floor, four balls, a monkey and a neon tube before a wall."""
    empty()
    ground = sheet("floor", 4, 64)
    ground.data.materials.append(checked())
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
    sun(2.0, angle=1)
    camera((0, -6.5, 2.2), (80, 0, 0))
    sky("interior.exr", 0.4)


def sheet(name, size, cells):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=cells, y_subdivisions=cells, size=2 * size)
    item = bpy.context.object
    item.name = name
    return item


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


def animated_sun():
    """A sundial: a rod on a disc, and a sun that is keyframed from morning to evening."""
    empty()
    floor(96)
    bpy.ops.mesh.primitive_cylinder_add(vertices=16, radius=0.08, depth=1.4, location=(0, 0, 0.7))
    smooth("rod", shader("bronze", **{"Base Color": (0.4, 0.25, 0.1, 1), **MATT}))
    _cut(bpy.context.object, 6)
    light = sun(4.0, (0, -60, 0))
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 24
    for frame, angle in ((1, -60), (24, 60)):
        light.rotation_euler = radians(20), radians(angle), 0
        light.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(1)
    sky("courtyard.exr", 0.3)
    camera((0, -5, 4), (54, 0, 0))
