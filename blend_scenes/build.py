"""Build the scenes of this folder: `python blend_scenes/build.py [NAME …] [--output FOLDER]`.

Everything comes from Blender's own primitives, so the files may be shipped. They are saved by the
oldest supported Blender (4.2), which every newer one opens.
"""

import argparse
import math
from pathlib import Path

import bpy
import numpy as np

FOLDER = Path(__file__).parent


def clear():
    """An empty file with a Cycles scene and a world of plain grey."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    bpy.context.scene.world = world
    bpy.context.scene.render.engine = "CYCLES"


def diffuse(name, colour):
    """A Diffuse BSDF of one colour: the same in every renderer."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*colour, 1)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def principled(name, colour):
    """A Principled BSDF without specular reflection."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Specular IOR Level"].default_value = 0
    shader.inputs["Roughness"].default_value = 1
    return material


def mesh_object(name, vertices, faces, material=None, smooth=False):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, v)) for v in vertices], [], [tuple(f) for f in faces])
    mesh.update()
    mesh.polygons.foreach_set("use_smooth", np.full(len(mesh.polygons), smooth))
    item = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(item)
    if material:
        mesh.materials.append(material)
    return item


def grid(name, n, low, high, material=None):
    """A square of n x n vertices on the plane z = 0."""
    side = np.linspace(low, high, n)
    x, y = np.meshgrid(side, side)
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.column_stack([first, first + 1, first + n + 1, first + n])
    return mesh_object(name, vertices, faces, material)


def added(name, material=None, smooth=False):
    """The object a primitive operator has just made, named and shaded."""
    item = bpy.context.object
    item.name = item.data.name = name
    if material:
        item.data.materials.clear()
        item.data.materials.append(material)
    item.data.polygons.foreach_set("use_smooth", np.full(len(item.data.polygons), smooth))
    return item


def apply_all(target):
    bpy.context.view_layer.objects.active = target
    for item in bpy.data.objects:
        item.select_set(item is target)
    for modifier in list(target.modifiers):
        bpy.ops.object.modifier_apply(modifier=modifier.name)
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)


def suzanne(name, material, levels, height):
    """Suzanne, subdivided and standing on z = 0, its modifiers and transform applied."""
    bpy.ops.mesh.primitive_monkey_add(rotation=(0, 0, 0))
    model = added(name, material, smooth=True)
    subdivision = model.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels = subdivision.render_levels = levels
    apply_all(model)
    position = np.empty(len(model.data.vertices) * 3, np.float32)
    model.data.vertices.foreach_get("co", position)
    position = position.reshape(-1, 3)
    low, high = position.min(axis=0), position.max(axis=0)
    position = (position - [*((low + high)[:2] / 2), low[2]]) * height / (high - low)[2]
    model.data.vertices.foreach_set("co", position.astype(np.float32).ravel())
    model.data.update()
    return model


def camera(location, target, lens=50):
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    item = bpy.data.objects.new("Camera", data)
    item.location = location
    look = np.array(target, float) - location
    yaw = math.atan2(look[1], look[0]) - math.pi / 2
    pitch = math.atan2(look[2], math.hypot(look[0], look[1])) + math.pi / 2
    item.rotation_euler = (pitch, 0, yaw)
    bpy.context.collection.objects.link(item)
    bpy.context.scene.camera = item
    return item


def lamp(name, kind, location, energy, rotation=(0, 0, 0), **settings):
    data = bpy.data.lights.new(name, kind)
    data.energy = energy
    for key, value in settings.items():
        setattr(data, key, value)
    item = bpy.data.objects.new(name, data)
    item.location, item.rotation_euler = location, rotation
    bpy.context.collection.objects.link(item)
    return item


def model_on_ground():
    """The papers' set-up: a model of 31,658 vertices on a 171 x 171 ground."""
    suzanne("model", diffuse("clay", (0.7, 0.65, 0.6)), 3, 1.6)
    grid("ground", 171, -2, 2, diffuse("floor", (0.5, 0.5, 0.5)))
    camera((1.9, -4.6, 2.2), (0, 0, 0.6))


def model_on_ground_small():
    """The same at a sixteenth of the points, for quick runs."""
    suzanne("model", diffuse("clay", (0.7, 0.65, 0.6)), 1, 1.6)
    grid("ground", 43, -2, 2, diffuse("floor", (0.5, 0.5, 0.5)))
    camera((1.9, -4.6, 2.2), (0, 0, 0.6))


def coloured_walls():
    """A red and a green wall bleed onto a floor, a box and a ball; four kinds of lamp."""
    # Narrow gaps: no vertex lies exactly on another surface, where renderers toss a coin.
    gap = 0.004
    white = principled("white", (0.75, 0.75, 0.75))
    grid("floor", 65, -1, 1, white)
    back = grid("back", 65, -1, 1, white)
    back.location, back.rotation_euler = (0, 1 + gap, 1 + gap), (math.pi / 2, 0, 0)
    for name, x, turn, colour in (
        ("red", -1 - gap, math.pi / 2, (0.7, 0.08, 0.05)),
        ("green", 1 + gap, -math.pi / 2, (0.1, 0.55, 0.08)),
    ):
        wall = grid(name, 65, -1, 1, principled(name, colour))
        wall.location, wall.rotation_euler = (x, 0, 1 + gap), (0, turn, 0)
    bpy.ops.mesh.primitive_cube_add(
        size=0.7, location=(-0.4, 0.3, 0.35 + gap), rotation=(0, 0, 0.4)
    )
    box = added("box", diffuse("box", (0.7, 0.7, 0.7)))
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=15)
    bpy.ops.object.mode_set(mode="OBJECT")
    apply_all(box)
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=64, ring_count=32, radius=0.35, location=(0.4, -0.2, 0.352)
    )
    added("ball", diffuse("ball", (0.8, 0.75, 0.4)), smooth=True)
    lamp("point", "POINT", (0.5, -0.6, 1.4), 20, shadow_soft_size=0.05)
    lamp("spot", "SPOT", (-0.5, -0.8, 1.8), 60, (0.6, 0, -0.2), shadow_soft_size=0.03)
    lamp("area", "AREA", (0.1, 0.2, 1.9), 15, size=0.4, shape="SQUARE")
    lamp("sun", "SUN", (0, 0, 3), 1.5, (0.7, 0.2, 0.3), angle=math.radians(6))
    camera((0, -4.6, 1.3), (0, 0, 0.8))


def sheets_and_leaves():
    """Open thin sheets and a bush of leaves over a floor."""
    rng = np.random.default_rng(3)
    grid("floor", 65, -2, 2, diffuse("floor", (0.6, 0.6, 0.6)))
    n = 49
    side = np.linspace(-0.8, 0.8, n)
    x, y = np.meshgrid(side, side)
    z = 1.1 + 0.15 * np.sin(4 * x) * np.cos(3 * y)
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.column_stack([first, first + 1, first + n + 1, first + n])
    mesh_object(
        "cloth",
        np.column_stack([x.ravel() - 0.8, y.ravel(), z.ravel()]),
        faces,
        diffuse("cloth", (0.75, 0.3, 0.25)),
        smooth=True,
    )
    vertices, leaves = [], []
    for i in range(160):
        centre = rng.normal(0, 0.35, 3) + [1.0, 0, 0.9]
        u, v = np.linalg.qr(rng.normal(size=(3, 2)))[0].T * 0.12
        vertices += [centre - u, centre + 0.4 * v, centre + u, centre - 0.4 * v]
        leaves.append(4 * i + np.arange(4))
    mesh_object("leaves", vertices, leaves, diffuse("leaf", (0.2, 0.5, 0.1)))
    camera((0.5, -5.5, 2.5), (0, 0, 0.7))


def street_bench():
    """A bench, lamp posts and railings: many thin occluders over a pavement."""
    grid("pavement", 121, -3, 3, diffuse("stone", (0.45, 0.44, 0.42)))
    wood, iron = diffuse("wood", (0.45, 0.25, 0.12)), diffuse("iron", (0.1, 0.1, 0.11))

    def bar(name, centre, size, material, cuts=7):
        bpy.ops.mesh.primitive_cube_add(size=1, location=centre, scale=size)
        item = added(name, material)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.subdivide(number_cuts=cuts)
        bpy.ops.object.mode_set(mode="OBJECT")
        apply_all(item)

    for i in range(4):
        bar(f"seat {i}", (0, 0.16 * i - 0.24, 0.45), (1.8, 0.12, 0.03), wood)
        bar(f"back {i}", (0, 0.34 + 0.03 * i, 0.58 + 0.14 * i), (1.8, 0.03, 0.1), wood)
    for x in (-0.8, 0.8):
        for y in (-0.25, 0.3):
            bar(f"leg {x} {y}", (x, y, 0.225), (0.05, 0.05, 0.46), iron)
    for x in (-2.2, 2.2):
        bpy.ops.mesh.primitive_cylinder_add(
            vertices=24, radius=0.05, depth=3.02, location=(x, 1, 1.5)
        )
        added(f"post {x}", iron, smooth=False)
        bpy.ops.mesh.primitive_uv_sphere_add(
            segments=32, ring_count=16, radius=0.2, location=(x, 1, 3.1)
        )
        added(f"globe {x}", diffuse(f"globe {x}", (0.8, 0.8, 0.75)), smooth=True)
        lamp(f"light {x}", "POINT", (x, 0.7, 3.1), 80, shadow_soft_size=0.1)
    for i in range(25):
        bar(f"rail {i}", (-2.4 + 0.2 * i, 1.6, 0.5), (0.03, 0.03, 1.02), iron, cuts=3)
    bar("hand rail", (0, 1.6, 1.02), (4.9, 0.06, 0.04), iron, cuts=15)
    camera((3.2, -5.5, 2.6), (0, 0.3, 0.7))


def instances():
    """A collection instanced with turned, scaled and mirrored copies; a curve and a text."""
    grid("floor", 65, -3, 3, diffuse("floor", (0.6, 0.6, 0.6)))
    source = bpy.data.collections.new("figure")
    figure = suzanne("figure", diffuse("figure", (0.5, 0.55, 0.7)), 1, 1)
    bpy.context.collection.objects.unlink(figure)
    source.objects.link(figure)
    for i in range(6):
        empty = bpy.data.objects.new(f"copy {i}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", source
        angle = math.tau * i / 6
        empty.location = (1.8 * math.cos(angle), 1.8 * math.sin(angle), 0)
        empty.rotation_euler = (0, 0, angle)
        empty.scale = (-1, 1, 1) if i % 2 else (1, 1, 1.3)
        bpy.context.collection.objects.link(empty)
    curve = bpy.data.curves.new("ring", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", 0.06, 4
    spline = curve.splines.new("POLY")
    spline.points.add(47)
    for i, point in enumerate(spline.points):
        angle = math.tau * i / 48
        point.co = (
            0.9 * math.cos(angle),
            0.9 * math.sin(angle),
            0.4 + 0.2 * math.sin(3 * angle),
            1,
        )
    spline.use_cyclic_u = True
    ring = bpy.data.objects.new("ring", curve)
    curve.materials.append(diffuse("ring", (0.8, 0.5, 0.2)))
    bpy.context.collection.objects.link(ring)
    text = bpy.data.curves.new("sign", "FONT")
    text.body, text.extrude, text.size = "PRT", 0.05, 0.7
    text.align_x = "CENTER"
    sign = bpy.data.objects.new("sign", text)
    sign.location, sign.rotation_euler = (0, 0, 0.05), (math.pi / 2, 0, 0)
    bpy.context.collection.objects.link(sign)
    camera((0.5, -7, 3.2), (0, 0, 0.5))


def hard_cases():
    """Zero-area, duplicate, flipped, coplanar and non-manifold faces, tiny and huge, far away."""
    far = np.array([1e4, -2e4, 300.0])
    grey = diffuse("grey", (0.6, 0.6, 0.6))
    floor = grid("floor", 33, -2, 2, grey)
    floor.location = far
    square = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0.0]])
    items = {
        "zero area": (
            np.vstack([square, [[0, 0, 0], [0, 0, 0], [1, 1, 0], [2, 2, 0]]]),
            [(0, 1, 2, 3), (4, 5, 6), (4, 6, 7)],
        ),
        "duplicate": (square, [(0, 1, 2), (0, 2, 3), (0, 1, 2, 3)]),
        "flipped": (square, [(3, 2, 1, 0)]),
        "coplanar": (np.vstack([square, square * 0.5]), [(0, 1, 2, 3), (4, 5, 6, 7)]),
        "non manifold": (
            np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 0.5, 0], [-0.5, -1, 0.0]]),
            [(0, 1, 2), (0, 1, 3), (1, 0, 4)],
        ),
        "needle": (np.array([[0, 0, 0], [2, 0, 0], [1, 1e-5, 0.0]]), [(0, 1, 2)]),
    }
    for i, (name, (vertices, faces)) in enumerate(items.items()):
        item = mesh_object(name, vertices, faces, grey)
        item.location = far + [(i % 3 - 1) * 1.2, (i // 3 - 0.5) * 1.6, 0.4]
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=1e-3, location=far + [0, 0, 1])
    added("tiny", grey, smooth=True)
    loose = mesh_object("loose points", [far, far + [1, 0, 0]], [])
    loose.data.materials.append(grey)
    mesh_object("empty", [], [])


def two_triangle_floor():
    """A floor of two triangles under a ball: hidden points must carry its bounce."""
    mesh_object(
        "floor",
        [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)],
        [(0, 1, 2), (0, 2, 3)],
        diffuse("floor", (0.8, 0.3, 0.2)),
    )
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=48, ring_count=24, radius=0.5, location=(0, 0, 0.502)
    )
    added("ball", diffuse("ball", (0.75, 0.75, 0.75)), smooth=True)
    camera((0, -5, 1.6), (0, 0, 0.4))


SCENES = {
    f"{i:02d}_{make.__name__}": make
    for i, make in enumerate(
        (
            model_on_ground,
            model_on_ground_small,
            coloured_walls,
            sheets_and_leaves,
            street_bench,
            instances,
            hard_cases,
            two_triangle_floor,
        ),
        1,
    )
}


def build(name, folder=FOLDER):
    """Write one scene; returns its path."""
    clear()
    SCENES[name]()
    path = Path(folder).resolve() / f"{name}.blend"
    path.parent.mkdir(parents=True, exist_ok=True)
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    return path


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="default: all")
    parser.add_argument("--output", default=FOLDER, help="default: this folder")
    options = parser.parse_args()
    for scene_name in options.names or SCENES:
        if scene_name not in SCENES:
            parser.error(f"no scene '{scene_name}'; there are {', '.join(SCENES)}")
        made_path = build(scene_name, options.output)
        print(f"{made_path.name}: {made_path.stat().st_size / 1e6:.2f} MB")
