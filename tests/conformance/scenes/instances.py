"""Geometry nodes, instances, libraries."""

import bpy

from tests.conformance.parts import (
    BLUE,
    RED,
    add,
    box,
    geometry_nodes,
    grid,
    ground,
    move,
    painted,
    plain,
    plate,
    put,
    wall,
    world,
)
from tests.conformance.scene import scene


def _cubes(tree, geometry, size=(0.5, 0.5, 0.5)):
    cube = add(tree, "GeometryNodeMeshCube", {"Size": size}).outputs[0]
    red = {"Geometry": cube, "Material": plain("cubes", RED)}
    cube = add(tree, "GeometryNodeSetMaterial", red).outputs[0]
    put_on = add(tree, "GeometryNodeInstanceOnPoints", {"Points": geometry, "Instance": cube})
    return put_on.outputs[0]


def _seeds():
    return grid("seeds", 2, 2.5, location=(0, 0, 0.3))


@scene(quick=True)
def nodes_that_instance(on):
    ground()
    world()
    if on:
        geometry_nodes(_seeds(), _cubes)


@scene()
def nodes_that_realise(on):
    ground()
    world()
    if on:

        def realised(tree, geometry):
            cubes = _cubes(tree, geometry)
            return add(tree, "GeometryNodeRealizeInstances", {"Geometry": cubes}).outputs[0]

        geometry_nodes(_seeds(), realised)


@scene()
def nodes_that_join_a_box_of_its_own_material(on):
    ground()
    world()
    item = wall(plain("wall", BLUE))

    def joined(tree, geometry):
        cube = add(tree, "GeometryNodeMeshCube", {"Size": (1.2, 1.2, 1.2)}).outputs[0]
        red = {"Geometry": cube, "Material": plain("red", RED)}
        cube = add(tree, "GeometryNodeSetMaterial", red).outputs[0]
        moved = {"Geometry": cube, "Translation": (0, 0, 1.5)}
        cube = add(tree, "GeometryNodeTransform", moved).outputs[0]
        join = add(tree, "GeometryNodeJoinGeometry")
        tree.links.new(geometry, join.inputs[0])
        tree.links.new(cube, join.inputs[0])
        return join.outputs[0]

    if on:
        geometry_nodes(item, joined)


@scene(quick=True)
def nodes_that_set_a_material(on):
    ground()
    world()
    item = wall(plain("wall", BLUE), scale=(1, 1, 1))
    if on:
        geometry_nodes(item, lambda tree, geometry: add(
            tree, "GeometryNodeSetMaterial", {"Geometry": geometry, "Material": plain("red", RED)}
        ).outputs[0])  # fmt: skip


@scene()
def nodes_that_write_an_attribute(on):
    def colour(tree):
        return add(tree, "ShaderNodeAttribute", attribute_name="height").outputs["Color"]

    item = ground(painted("ground", colour))
    world()

    def stored(tree, geometry):
        kind = "GeometryNodeStoreNamedAttribute"
        inputs = {"Geometry": geometry, "Name": "height"}
        node = add(tree, kind, inputs, data_type="FLOAT_VECTOR", domain="POINT")
        value = next(s for s in node.inputs if s.enabled and s.name == "Value")
        tree.links.new(add(tree, "GeometryNodeInputPosition").outputs[0], value)
        return node.outputs[0]

    if on:
        geometry_nodes(item, stored)


@scene()
def instances_on_vertices(on):
    ground()
    world()
    parent = grid("seeds", 2, 2.5, location=(0, 0, 0.3))
    child = box("cube", plain("cube", RED), 0.6, location=(0, 0, 0))
    child.parent = parent
    parent.instance_type = "VERTS" if on else "NONE"
    parent.show_instancer_for_render = False


@scene()
def instances_on_faces(on):
    ground()
    world()
    parent = grid("seeds", 3, 3, location=(0, 0, 0.3))
    child = box("cube", plain("cube", RED), 0.6, location=(0, 0, 0))
    child.parent = parent
    parent.instance_type = "FACES" if on else "NONE"
    parent.show_instancer_for_render = False


@scene(quick=True)
def collection_instances(on):
    ground()
    world()
    library = bpy.data.collections.new("chairs")
    move(box(size=0.8, location=(0, 0, 0)), library)
    for x in (-1, 1) if on else ():
        item = put("chair", None, location=(x, 0, 0.5), rotation=(0, 0, x))
        item.instance_type, item.instance_collection = "COLLECTION", library


def _library():
    """A .blend with a plate, beside the scene."""
    path = f"{bpy.app.tempdir}library.blend"
    item = plate()
    bpy.data.libraries.write(path, {item}, fake_user=True)
    mesh = item.data
    bpy.data.objects.remove(item)
    bpy.data.meshes.remove(mesh)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["plate"]
    return wanted.objects[0]


@scene(quick=True)
def linked_object(on):
    ground()
    world()
    item = _library()
    if on:
        bpy.context.scene.collection.objects.link(item)


@scene()
def library_override(on):
    ground()
    world()
    item = _library()
    bpy.context.scene.collection.objects.link(item)
    if on:
        local = item.override_create(remap_local_usages=True)
        local.location = 0.5, 0.5, 1.0
