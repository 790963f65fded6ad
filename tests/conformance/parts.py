"""What the scenes are put together from: surfaces, materials, lamps, worlds."""

import math

import bpy
import numpy as np

from blend_scenes.build import diffuse as plain
from blend_scenes.build import lamp, mesh_object

GREY, RED, GREEN, BLUE = (0.6, 0.6, 0.6), (0.9, 0.05, 0.05), (0.05, 0.7, 0.1), (0.1, 0.1, 0.8)
# Keywords of `wall`: as tall as the ground is wide.
BESIDE = {"scale": (1, 1, 1), "location": (-2, 0, 2)}
BOX_CORNERS = [(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
BOX_FACES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def place(item, location=(0, 0, 0), rotation=(0, 0, 0), scale=(1, 1, 1)):
    item.location, item.rotation_euler, item.scale = location, rotation, scale
    return item


def put(name, data, collection=None, **where):
    """An object of a data-block, in the scene or in a collection."""
    item = bpy.data.objects.new(name, data)
    (collection or bpy.context.scene.collection).objects.link(item)
    return place(item, **where)


def grid(name, cells, size, material=None, **where):
    """A square of quads on z = 0 that looks up, with a UV map of the unit square."""
    side = np.linspace(-0.5, 0.5, cells + 1)
    x, y = np.meshgrid(side, side)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    faces = np.column_stack([first, first + 1, first + cells + 2, first + cells + 1])
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    item = mesh_object(name, vertices * size, faces, material)
    uv = item.data.uv_layers.new(name="UVMap")
    uv.data.foreach_set("uv", (vertices[faces.ravel(), :2] + 0.5).astype(np.float32).ravel())
    return place(item, **where)


def ground(material=None, cells=12, **where):
    """What most scenes look at: 4 x 4 in size."""
    return grid("ground", cells, 4, material or plain("ground", GREY), **where)


def wall(material=None, **where):
    """Beside the ground, red, its front towards it."""
    where = {"location": (-2, 0, 1), "rotation": (0, math.pi / 2, 0), "scale": (0.5, 1, 1)} | where
    return grid("wall", 8, 4, material or plain("wall", RED), **where)


def plate(name="plate", material=None, size=2, **where):
    """A closed slab above the ground, red."""
    where = {"location": (0, 0, 0.4)} | where
    corners = np.array(BOX_CORNERS) * (size, size, 0.1)
    return place(mesh_object(name, corners, BOX_FACES, material or plain(name, RED)), **where)


def sheet(name, material, size=2, cells=4, **where):
    """A square without a thickness above the ground, looking up."""
    return grid(name, cells, size, material, **({"location": (0, 0, 0.6)} | where))


def box(name="box", material=None, size=1, **where):
    where = {"location": (0, 0, 0.55)} | where
    corners = np.array(BOX_CORNERS) * size
    return place(mesh_object(name, corners, BOX_FACES, material or plain(name, RED)), **where)


def ball(name, material, radius=0.5, rings=12, segments=24, **where):
    """A sphere in flat shading; Blender's operator has no fixed order of corners."""
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    height = np.linspace(np.pi, 0, rings + 1)[1:-1, None]
    ring = np.stack([np.sin(height) * np.cos(angle), np.sin(height) * np.sin(angle),
                     np.cos(height) + 0 * angle], axis=-1)  # fmt: skip
    vertices = np.concatenate([[(0, 0, -1)], ring.reshape(-1, 3), [(0, 0, 1)]]) * radius
    first = 1 + np.arange(segments)
    after, top, last = np.roll(first, -1), (rings - 2) * segments, len(vertices) - 1
    faces = [(0, b, a) for a, b in zip(first, after, strict=True)]
    for step in range(0, top, segments):
        faces += (np.stack([first, after, after + segments, first + segments], 1) + step).tolist()
    faces += [(a + top, b + top, last) for a, b in zip(first, after, strict=True)]
    return place(mesh_object(name, vertices, faces, material), **where)


ABOVE, LEANING = (0.2, -0.1, 1.2), (0.3, -0.4, 0.7)


def lamp_above(kind, energy=60, location=ABOVE, rotation=LEANING, scale=(1, 1, 1), **settings):
    """The lamp of most scenes, over the ground."""
    item = lamp("lamp", kind, location, energy, rotation, **settings)
    item.scale = scale
    return item


def add(tree, kind, inputs=(), **settings):
    """A node; each of `inputs`, by name or number, is a value or the socket that it comes from."""
    node = tree.nodes.new(kind)
    for key, value in settings.items():
        setattr(node, key, value)
    for key, value in dict(inputs).items():
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, node.inputs[key])
        else:
            node.inputs[key].default_value = value
    return node


def shaded(name, surface):
    """A material whose surface is the socket that `surface(tree)` gives."""
    material = bpy.data.materials.new(name)
    tree = _empty_tree(material)
    add(tree, "ShaderNodeOutputMaterial", {"Surface": surface(tree)})
    return material


def painted(name, colour):
    """A Diffuse BSDF of the colour that `colour(tree)` gives."""
    return shaded(name, lambda t: add(t, "ShaderNodeBsdfDiffuse", {"Color": colour(t)}).outputs[0])


def shader(name, kind, inputs=(), **settings):
    """A material of one shader."""
    return shaded(name, lambda tree: add(tree, kind, inputs, **settings).outputs[0])


def principled(name, inputs):
    """A Principled BSDF without specular reflection, unless `inputs` ask for it."""
    return shader(name, "ShaderNodeBsdfPrincipled", {"Specular IOR Level": 0, **inputs})


def emission(name, colour, strength):
    return shader(name, "ShaderNodeEmission", {"Color": (*colour, 1), "Strength": strength})


def world(strength=1.0, colour=(1, 1, 1), surface=None):
    """A plain sky, or the socket that `surface(tree)` gives."""
    sky = bpy.data.worlds.new("world")
    bpy.context.scene.world = sky
    tree = _empty_tree(sky)
    background = {"Color": (*colour, 1), "Strength": strength}
    if surface is None:
        socket = add(tree, "ShaderNodeBackground", background).outputs[0]
    else:
        socket = surface(tree)
    add(tree, "ShaderNodeOutputWorld", {"Surface": socket})
    return sky


def _empty_tree(owner):
    if owner.node_tree is None:
        owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree


def image(name, pixels, linear=False):
    """A packed 8-bit image of (height, width, 3 or 4) values, its first row on top."""
    pixels = np.asarray(pixels, np.float32)[::-1]
    height, width, channels = pixels.shape
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :channels] = pixels
    picture = bpy.data.images.new(name, width, height, alpha=channels == 4)
    if linear:
        picture.colorspace_settings.name = "Non-Color"
    picture.pixels.foreach_set(rgba.ravel())
    picture.pack()
    return picture


def patches(columns=4, rows=4, seed=0):
    """(rows, columns, 3) of bright and dark colours."""
    return np.random.default_rng(seed).choice([0.1, 0.9], (rows, columns, 3))


def modifier(item, kind, **settings):
    result = item.modifiers.new(kind.lower(), kind)
    for key, value in settings.items():
        setattr(result, key, value)
    return result


def geometry_nodes(item, result):
    """Give an object the geometry that `result(tree, geometry)` makes of its own."""
    tree = bpy.data.node_groups.new(item.name, "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    source, target = add(tree, "NodeGroupInput"), add(tree, "NodeGroupOutput")
    tree.links.new(result(tree, source.outputs[0]), target.inputs[0])
    modifier = item.modifiers.new("nodes", "NODES")
    modifier.node_group = tree
    return modifier


def new_collection(name, *items, home=None):
    """A collection of these objects, in the scene or in another one."""
    collection = bpy.data.collections.new(name)
    (home or bpy.context.scene.collection).children.link(collection)
    for item in items:
        collection.objects.link(item)
    return collection


def move(item, collection):
    """The object, out of all its collections into this one."""
    for old in list(item.users_collection):
        old.objects.unlink(item)
    collection.objects.link(item)
    return item
