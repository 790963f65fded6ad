"""Scenes that the stories build, and the way to the add-on's panel."""

import time

import bpy
import numpy as np
from hand import FOLDER, Until

# Seconds within which a button's work has begun.
_BEGINS = 3.0


def mesh_of(name, size, cells=1):
    """A cube, or with several cells a square sheet of them."""
    mesh = bpy.data.meshes.new(name)
    if cells == 1:
        corners = [(x, y, z) for z in (-size, size) for y in (-size, size) for x in (-size, size)]
        faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    else:
        step, n = 2 * size / cells, cells + 1
        corners = [(i * step - size, j * step - size, 0) for j in range(n) for i in range(n)]
        faces = [(k, k + 1, k + n + 1, k + n) for k in range(n * cells) if k % n < cells]
    mesh.from_pydata(corners, [], faces)
    return mesh


def put(name, data, place=(0, 0, 0), collection=None):
    item = bpy.data.objects.new(name, data)
    item.location = place
    (collection or bpy.context.scene.collection).objects.link(item)
    return item


def smooth(name, material):
    """The active object by another name, shaded smooth, in a material."""
    item = bpy.context.object
    item.name = name
    item.data.materials.append(material)
    item.data.polygons.foreach_set("use_smooth", np.ones(len(item.data.polygons), bool))
    return item


def shader(name, **values):
    """A Principled material with some of its inputs."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    node = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    for socket, value in values.items():
        node.inputs[socket].default_value = value
    return material


def floor_with(*names):
    """An empty file with a floor and some of: shared, instanced, linked, subdivided."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    put("floor", mesh_of("floor", 2, 24))
    if "shared" in names:
        mesh = mesh_of("pair", 0.3)
        put("left", mesh, (-1.2, 0, 0.3))
        put("right", mesh, (1.2, 0, 0.3)).scale.x = -1.2
    if "instanced" in names:
        parts = bpy.data.collections.new("parts")
        put("part", mesh_of("part", 0.15), (0, 0, 0.15), parts)
        group = put("group", None, (0, 1.2, 0))
        group.instance_type, group.instance_collection = "COLLECTION", parts
    if "linked" in names:
        library = str(FOLDER / "library.blend")
        far = bpy.data.objects.new("linked", mesh_of("linked", 0.25))
        far.location = 0, -1.2, 0.25
        bpy.data.libraries.write(library, {far}, fake_user=True)
        bpy.data.objects.remove(far)
        with bpy.data.libraries.load(library, link=True) as (_, wanted):
            wanted.objects = ["linked"]
        bpy.context.scene.collection.objects.link(wanted.objects[0])
    if "subdivided" in names:
        put("fine", mesh_of("fine", 0.3), (0, 0, 0.6)).modifiers.new("Fine", "SUBSURF").levels = 2
    for node in bpy.context.scene.world.node_tree.nodes:
        if node.type == "BACKGROUND":
            node.inputs["Color"].default_value = 0.7, 0.8, 1.0, 1.0
    bpy.context.scene.prt.resolution = "16"


def to_panel(hand):
    """The sidebar's tab of the add-on, with everything in view."""
    hand.view.spaces.active.overlay.show_overlays = False
    yield from hand.to_view()
    yield from hand.key("HOME")
    if hand.sidebar.width < 100:
        yield from hand.key("N")
    yield Until("the sidebar is there", lambda: hand.sidebar.width > 100)
    yield 0.5
    hand.sidebar.active_panel_category = "PRT"
    hand.view.tag_redraw()
    yield 0.5


def press(hand, button, status, at=0.45, seconds=120):
    """Press a button and wait until its work is done; after so many seconds it is an error."""
    before = status().message
    yield from hand.click(button, at)
    yield from _done(button, status, before, seconds)


def confirm(hand, button, status, at=0.45, seconds=120):
    """Press a button that asks in a dialog, take what it proposes, and wait until it is done."""
    before = status().message
    yield from hand.click(button, at)
    yield 1.0
    yield from hand.key("RET")
    yield from _done(button, status, before, seconds)


def _done(button, status, before, seconds):
    """Wait until a button's work has begun, or has been done meanwhile, and until it is done."""
    pressed = time.monotonic()
    while not status().running and status().message == before:
        # On a busy machine the window takes its time; some buttons say nothing.
        if time.monotonic() - pressed > _BEGINS:
            break
        yield 0.05
    yield Until(f"{button} is done", lambda: not status().running, seconds)
    yield 0.5
