"""Shapes, transforms, sizes and places."""

import math

import bpy
from mathutils import Matrix

from tests.conformance.parts import (
    BLUE,
    BOX_CORNERS,
    BOX_FACES,
    GREY,
    RED,
    add,
    box,
    ground,
    lamp,
    mesh_object,
    place,
    plain,
    plate,
    put,
    sheet,
    wall,
    world,
)
from tests.conformance.scene import scene


@scene(targets=("ground", "plate"), quick=True)
def negative_scale(on):
    ground()
    world()
    item = plate(size=1.5)
    item.data.transform(Matrix.Translation((1, 0, 0)))
    item.scale = (-1 if on else 1), 1, 1


@scene()
def sheared_by_its_parent(on):
    ground()
    world()
    parent = put("parent", None, rotation=(0, 0, 0.6), scale=(-1, 1.8, 0.7) if on else (1, 1, 1))
    item = wall(rotation=(0, math.pi / 2, 0.4), location=(-1, 0, 1.1))
    item.parent = parent


@scene(targets=("sheet",))
def custom_normals(on):
    world()
    item = sheet("sheet", plain("sheet", RED), 2, 8)
    if on:
        item.data.polygons.foreach_set("use_smooth", [True] * len(item.data.polygons))
        normals = [(0.8, 0, 0.6)] * len(item.data.vertices)
        item.data.normals_split_custom_set_from_vertices(normals)


@scene(light="lamps", targets=("ridge",), quick=True)
def smooth_but_for_sharp_edges(on):
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0, -0.9, 0))
    profile = [(-1.5, 0), (-0.8, 0.7), (0.8, 0.7), (1.5, 0)]
    corners = [(x, y, z) for y in (-1, 1) for x, z in profile]
    faces = [(i, i + 1, i + 5, i + 4) for i in range(3)]
    item = mesh_object("ridge", corners, faces, plain("ridge", GREY), smooth=True)
    if on:
        for edge in item.data.edges:
            edge.use_edge_sharp = set(edge.vertices) == {1, 5}


@scene()
def flat_to_zero(on):
    ground()
    world()
    box(size=1.5, scale=(1, 1, 0) if on else (1, 1, 1), location=(0, 0, 0.8))


@scene(quick=True)
def loose_parts(on):
    ground()
    world()
    if on:
        mesh = bpy.data.meshes.new("parts")
        corners = [(1.6 * x, 1.6 * y, 0.6 + z) for x, y, z in BOX_CORNERS]
        mesh.from_pydata([*corners, (9, 9, 9), (1, 1, 1), (1, 1, 2)], [(9, 10)], BOX_FACES)
        mesh.materials.append(plain("parts", RED))
        put("parts", mesh)
        put("nothing", bpy.data.meshes.new("nothing"))


@scene()
def concave_polygon(on):
    ground()
    world()
    rim = [(-1.4, -1.4), (1.4, -1.4), (1.4, 1.4), (0, -0.9 if on else 1.4), (-1.4, 1.4)]
    corners = [(x, y, z) for z in (0.4, 0.5) for x, y in rim]
    sides = [(i, (i + 1) % 5, (i + 1) % 5 + 5, i + 5) for i in range(5)]
    faces = [(4, 3, 2, 1, 0), (5, 6, 7, 8, 9), *sides]
    mesh_object("polygon", corners, faces, plain("polygon", RED))


@scene()
def bent_quad(on):
    ground()
    world()
    high, low = (1.6, 0.1) if on else (0.5, 0.5)
    rim = [(-1.2, -1.2, high), (1.2, -1.2, low), (1.2, 1.2, high), (-1.2, 1.2, low)]
    corners = [*rim, *((x, y, z + 0.05) for x, y, z in rim)]
    sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
    mesh_object("quad", corners, [(3, 2, 1, 0), (4, 5, 6, 7), *sides], plain("quad", BLUE))


@scene(says=("plate", "displacement"))
def displaced_by_its_material(on):
    ground()
    world()
    material = plain("plate", RED)
    tree = material.node_tree
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    height = {"Height": 0.3 if on else 0, "Midlevel": 0, "Scale": 1}
    tree.links.new(
        add(tree, "ShaderNodeDisplacement", height).outputs[0], output.inputs["Displacement"]
    )
    material.displacement_method = "DISPLACEMENT"
    plate(material=material, size=1.2, location=(0, 0, 0.6))


@scene(bound=0.05)
def far_from_the_origin(on):
    # A site of 400 m in the coordinates of a map.
    place(ground(), (6e5, 5e6, 100), scale=(100, 100, 100))
    world()
    if on:
        box(location=(6e5, 5e6, 155), scale=(100, 100, 100))


@scene()
def two_millimetres_in_size(on):
    place(ground(), scale=(5e-4, 5e-4, 5e-4))
    world()
    if on:
        box(location=(0, 0, 2.6e-4), scale=(5e-4, 5e-4, 5e-4))


@scene()
def two_kilometres_in_size(on):
    place(ground(), scale=(500, 500, 500))
    world()
    if on:
        box(location=(0, 0, 260), scale=(500, 500, 500))


@scene(says=("fog", "volume"), samples=4096)
def fog(on):
    ground()
    world()
    material = bpy.data.materials.new("fog")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    volume = add(tree, "ShaderNodeVolumePrincipled", {"Density": 2.0, "Color": (*GREY, 1)})
    add(tree, "ShaderNodeOutputMaterial", {"Volume": volume.outputs[0]})
    if on:
        box("fog", material, 1.5, location=(0, 0, 0.9))
