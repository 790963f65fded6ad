"""Geometry as renders have it: modifiers, what is shown where, curves, hair, instances, shapes."""

import math

import bpy
from mathutils import Matrix

from tests.conformance.parts import (
    BLUE,
    BOX_CORNERS,
    BOX_FACES,
    GREEN,
    GREY,
    RED,
    add,
    ball,
    box,
    geometry_nodes,
    grid,
    ground,
    lamp,
    mesh_object,
    move,
    new_collection,
    painted,
    place,
    plain,
    plate,
    put,
    sheet,
    wall,
    world,
)
from tests.conformance.scene import scene

UP = {"location": (0, 0, 1), "size": 1.6}


def modifier(item, kind, **settings):
    result = item.modifiers.new(kind.lower(), kind)
    for key, value in settings.items():
        setattr(result, key, value)
    return result


# ---- modifiers


@scene(quick=True)
def subdivision_in_renders(on):
    ground(), world()
    modifier(box(**UP), "SUBSURF", levels=0, render_levels=3 if on else 0)


@scene()
def multires_in_renders(on):
    ground(), world()
    item = box(**UP)
    bpy.context.view_layer.objects.active = item
    detail = modifier(item, "MULTIRES")
    for _ in range(3):
        bpy.ops.object.multires_subdivide(modifier=detail.name)
    detail.levels, detail.render_levels = 0, 3 if on else 0


@scene(quick=True)
def array_in_renders(on):
    ground(), world()
    array = modifier(box(size=0.5, location=(-1.5, 0, 0.3)), "ARRAY", count=5)
    array.relative_offset_displace = 1.3, 0, 0
    array.show_viewport, array.show_render = False, on


@scene()
def array_in_the_viewport_only(on):
    ground(), world()
    array = modifier(box(size=0.5, location=(-1.5, 0, 0.3)), "ARRAY", count=5)
    array.relative_offset_displace = 1.3, 0, 0
    array.show_render = not on


@scene()
def mirror_modifier(on):
    ground(), world()
    item = box(size=0.8, location=(0, 0, 0.5))
    item.data.transform(Matrix.Translation((-1.2, 0, 0)))
    modifier(item, "MIRROR", show_viewport=False, show_render=on)


@scene()
def solidify_modifier(on):
    ground(), world()
    modifier(
        sheet("plate", plain("plate", RED), 1, location=(0, 0, 1.2)), "SOLIDIFY",
        thickness=1.1, offset=-1, show_viewport=False, show_render=on,
    )  # fmt: skip


@scene()
def bevel_modifier(on):
    ground(), world()
    modifier(
        box(**UP), "BEVEL", width=0.7, segments=3, show_viewport=False, show_render=on
    )  # fmt: skip


@scene()
def decimate_in_renders(on):
    ground(), world()
    item = ball("ball", plain("ball", RED), 0.9, location=(0, 0, 0.95))
    modifier(item, "DECIMATE", ratio=0.01, show_viewport=False, show_render=on)


@scene()
def boolean_with_a_hidden_cutter(on):
    ground(), world()
    item, cutter = box(size=1.8, location=(0, 0, 1)), box("cutter", location=(0, 0, 0.3))
    cutter.scale = 3, 3, 1.8
    cutter.hide_render = True
    if on:
        modifier(item, "BOOLEAN", object=cutter, solver="EXACT")


@scene()
def wireframe_modifier(on):
    ground(), world()
    modifier(box(**UP), "WIREFRAME", thickness=0.2, show_viewport=False, show_render=on)


@scene()
def render_simplify(on):
    ground(), world()
    modifier(box(**UP), "SUBSURF", levels=3, render_levels=3)
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision_render = on, 0


@scene()
def armature_pose(on):
    ground(), world()
    item = plate(location=(0, 0, 0.2))
    bones = put("bones", bpy.data.armatures.new("bones"))
    bpy.context.view_layer.objects.active = bones
    bpy.ops.object.mode_set(mode="EDIT")
    bone = bones.data.edit_bones.new("bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    item.vertex_groups.new(name="bone").add(range(len(item.data.vertices)), 1, "REPLACE")
    modifier(item, "ARMATURE", object=bones)
    if on:
        bones.pose.bones["bone"].location = 0, 0.9, 0


@scene()
def lattice_modifier(on):
    ground(), world()
    item = box(size=0.8, location=(0, 0, 0.6))
    cage = put("cage", bpy.data.lattices.new("cage"), location=(0, 0, 0.6), scale=(1, 1, 1))
    modifier(item, "LATTICE", object=cage)
    if on:
        for point in cage.data.points:
            point.co_deform = [c * f for c, f in zip(point.co, (2.4, 2.4, 0.6), strict=True)]


@scene(quick=True)
def shape_key(on):
    ground(), world()
    item = plate(location=(0, 0, 0.1))
    item.shape_key_add(name="Basis")
    key = item.shape_key_add(name="up")
    for point in key.data:
        point.co.z += 0.8
    key.value = float(on)


@scene()
def driven_by_the_frame(on):
    ground(), world()
    item = plate()
    driver = item.driver_add("location", 2).driver
    driver.expression = "0.1 * frame" if on else "0.1"
    bpy.context.scene.frame_set(9)


# ---- what is shown where


@scene(quick=True)
def hidden_by_the_eye(on):
    ground(), world()
    (plate() if on else put("nothing", None)).hide_set(True)


@scene()
def off_in_viewports(on):
    ground(), world()
    if on:
        plate().hide_viewport = True


@scene()
def off_in_renders(on):
    ground(), world()
    plate().hide_render = on


@scene()
def collection_off_in_renders(on):
    ground(), world()
    move(plate(), new_collection("drafts")).users_collection[0].hide_render = on


@scene(quick=True)
def collection_off_in_viewports(on):
    ground(), world()
    if on:
        move(plate(), new_collection("heavy")).users_collection[0].hide_viewport = True


@scene()
def collection_hidden_by_the_eye(on):
    ground(), world()
    if on:
        move(plate(), new_collection("heavy"))
        bpy.context.view_layer.layer_collection.children["heavy"].hide_viewport = True


@scene()
def collection_excluded(on):
    ground(), world()
    move(plate(), new_collection("drafts"))
    bpy.context.view_layer.layer_collection.children["drafts"].exclude = on


@scene()
def view_layer_with_a_material(on):
    world(), ground(plain("ground", GREY)), wall(plain("wall", RED), scale=(1, 1, 1))
    if on:
        bpy.context.view_layer.material_override = plain("clay", (0.2, 0.8, 0.4))


# ---- other kinds of objects


@scene(quick=True)
def text(on):
    ground(), world()
    if on:
        data = bpy.data.curves.new("text", "FONT")
        data.body, data.size, data.extrude, data.align_x = "HIM", 2.2, 0.3, "CENTER"
        data.materials.append(plain("text", RED))
        put("text", data, location=(0, -0.8, 0.5))


@scene()
def curve_with_a_bevel(on):
    ground(), world()
    data = bpy.data.curves.new("pipe", "CURVE")
    data.dimensions, data.bevel_depth = "3D", 0.35 if on else 0.02
    spline = data.splines.new("POLY")
    spline.points.add(2)
    for point, at in zip(spline.points, [(-1.5, -1, 0), (0, 1, 0.3), (1.5, -1, 0)], strict=True):
        point.co = (*at, 1)
    data.materials.append(plain("pipe", RED))
    put("pipe", data, location=(0, 0, 0.6))


@scene()
def curve_resolution_of_renders(on):
    ground(), world()
    data = bpy.data.curves.new("disc", "CURVE")
    data.dimensions, data.fill_mode, data.resolution_u = "2D", "BOTH", 1
    data.render_resolution_u = 8 if on else 1
    spline = data.splines.new("BEZIER")
    spline.bezier_points.add(1)
    for point, side in zip(spline.bezier_points, (-1, 1), strict=True):
        point.co = 1.4 * side, 0, 0
        point.handle_left, point.handle_right = (
            (1.4 * side, -1.8 * side, 0),
            (1.4 * side, 1.8 * side, 0),
        )
    spline.use_cyclic_u = True
    data.materials.append(plain("disc", RED))
    put("disc", data, location=(0, 0, 0.4))


@scene()
def metaballs(on):
    ground(), world()
    if on:
        data = bpy.data.metaballs.new("drops")
        data.resolution = data.render_resolution = 0.15
        for x in (-0.5, 0.5):
            element = data.elements.new()
            element.co, element.radius = (x, 0, 0), 1.2
        data.materials.append(plain("drops", RED))
        put("drops", data, location=(0, 0, 0.8))


@scene()
def nurbs_surface(on):
    ground(), world()
    if on:
        bpy.ops.surface.primitive_nurbs_surface_sphere_add(radius=1.2, location=(0, 0, 0.9))
        bpy.context.object.data.materials.append(plain("drop", RED))


def _emitter():
    return grid("emitter", 4, 2, plain("soil", (0.3, 0.2, 0.1)), location=(0, 0, 0.05))


@scene(says=("emitter", "particle"))
def particle_hair(on):
    ground(), world()
    settings = modifier(_emitter(), "PARTICLE_SYSTEM").particle_system.settings
    settings.type, settings.count, settings.hair_length = "HAIR", 300 if on else 0, 0.9
    settings.root_radius = settings.tip_radius = 8.0


@scene()
def particle_objects(on):
    ground(), world()
    leaf = box("leaf", plain("leaf", GREEN), 0.5, location=(50, 0, 0))
    settings = modifier(_emitter(), "PARTICLE_SYSTEM").particle_system.settings
    settings.type, settings.use_advanced_hair = "HAIR", True
    settings.count, settings.render_type, settings.instance_object = 12 if on else 0, "OBJECT", leaf
    settings.particle_size = 1.0


@scene(says=("fringe", "hair"))
def hair_curves(on):
    ground(), world()
    if on:
        data = bpy.data.hair_curves.new("fringe")
        data.add_curves([2] * 7)
        for number, curve in enumerate(data.curves):
            for point, y in zip(curve.points, (-1.5, 1.5), strict=True):
                point.position, point.radius = (0.4 * number - 1.2, y, 0.5), 0.15
        data.materials.append(plain("fringe", RED))
        put("fringe", data)


@scene(says=("dust", "point"))
def point_cloud(on):
    ground(), world()
    if on:
        source = put("dust", bpy.data.meshes.new("dust"), location=(0, 0, 0.6))
        source.data.from_pydata([(x, y, 0) for x in (-1, 0, 1) for y in (-1, 0, 1)], [], [])

        def points(tree, geometry):
            cloud = add(tree, "GeometryNodeMeshToPoints", {"Mesh": geometry, "Radius": 0.4})
            paint = {"Geometry": cloud.outputs[0], "Material": plain("dust", RED)}
            return add(tree, "GeometryNodeSetMaterial", paint).outputs[0]

        geometry_nodes(source, points)


# ---- geometry nodes and instances


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
    ground(), world()
    if on:
        geometry_nodes(_seeds(), _cubes)


@scene()
def nodes_that_realise(on):
    ground(), world()
    if on:

        def realised(tree, geometry):
            cubes = _cubes(tree, geometry)
            return add(tree, "GeometryNodeRealizeInstances", {"Geometry": cubes}).outputs[0]

        geometry_nodes(_seeds(), realised)


@scene()
def nodes_that_join_a_box_of_its_own_material(on):
    ground(), world()
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
    ground(), world()
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
    ground(), world()
    parent = grid("seeds", 2, 2.5, location=(0, 0, 0.3))
    child = box("cube", plain("cube", RED), 0.6, location=(0, 0, 0))
    child.parent = parent
    parent.instance_type = "VERTS" if on else "NONE"
    parent.show_instancer_for_render = False


@scene()
def instances_on_faces(on):
    ground(), world()
    parent = grid("seeds", 3, 3, location=(0, 0, 0.3))
    child = box("cube", plain("cube", RED), 0.6, location=(0, 0, 0))
    child.parent = parent
    parent.instance_type = "FACES" if on else "NONE"
    parent.show_instancer_for_render = False


@scene(quick=True)
def collection_instances(on):
    ground(), world()
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
    ground(), world()
    item = _library()
    if on:
        bpy.context.scene.collection.objects.link(item)


@scene()
def library_override(on):
    ground(), world()
    item = _library()
    bpy.context.scene.collection.objects.link(item)
    if on:
        local = item.override_create(remap_local_usages=True)
        local.location = 0.5, 0.5, 1.0


# ---- shapes and places


@scene(targets=("ground", "plate"))
def negative_scale(on):
    ground(), world()
    item = plate(size=1.5)
    item.data.transform(Matrix.Translation((1, 0, 0)))
    item.scale = (-1 if on else 1), 1, 1


@scene()
def sheared_by_its_parent(on):
    ground(), world()
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
    ground(), world()
    box(size=1.5, scale=(1, 1, 0) if on else (1, 1, 1), location=(0, 0, 0.8))


@scene()
def loose_parts(on):
    ground(), world()
    if on:
        mesh = bpy.data.meshes.new("parts")
        corners = [(1.6 * x, 1.6 * y, 0.6 + z) for x, y, z in BOX_CORNERS]
        mesh.from_pydata([*corners, (9, 9, 9), (1, 1, 1), (1, 1, 2)], [(9, 10)], BOX_FACES)
        mesh.materials.append(plain("parts", RED))
        put("parts", mesh)
        put("nothing", bpy.data.meshes.new("nothing"))


@scene()
def concave_polygon(on):
    ground(), world()
    rim = [(-1.4, -1.4), (1.4, -1.4), (1.4, 1.4), (0, -0.9 if on else 1.4), (-1.4, 1.4)]
    corners = [(x, y, z) for z in (0.4, 0.5) for x, y in rim]
    sides = [(i, (i + 1) % 5, (i + 1) % 5 + 5, i + 5) for i in range(5)]
    faces = [(4, 3, 2, 1, 0), (5, 6, 7, 8, 9), *sides]
    mesh_object("polygon", corners, faces, plain("polygon", RED))


@scene()
def bent_quad(on):
    ground(), world()
    high, low = (1.6, 0.1) if on else (0.5, 0.5)
    rim = [(-1.2, -1.2, high), (1.2, -1.2, low), (1.2, 1.2, high), (-1.2, 1.2, low)]
    corners = [*rim, *((x, y, z + 0.05) for x, y, z in rim)]
    sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
    mesh_object("quad", corners, [(3, 2, 1, 0), (4, 5, 6, 7), *sides], plain("quad", BLUE))


@scene(says=("plate", "displacement"))
def displaced_by_its_material(on):
    ground(), world()
    material = plain("plate", RED)
    tree = material.node_tree
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    height = {"Height": 0.8 if on else 0, "Midlevel": 0, "Scale": 1}
    tree.links.new(
        add(tree, "ShaderNodeDisplacement", height).outputs[0], output.inputs["Displacement"]
    )
    material.displacement_method = "DISPLACEMENT"
    plate(material=material, location=(0, 0, 0.2))


@scene(bound=0.05)
def far_from_the_origin(on):
    place(ground(), (6e5, 5e6, 100)), world()
    if on:
        box(location=(6e5, 5e6, 100.5))


@scene()
def two_millimetres_in_size(on):
    place(ground(), scale=(5e-4, 5e-4, 5e-4)), world()
    if on:
        box(location=(0, 0, 2.6e-4), scale=(5e-4, 5e-4, 5e-4))


@scene()
def two_kilometres_in_size(on):
    place(ground(), scale=(500, 500, 500)), world()
    if on:
        box(location=(0, 0, 260), scale=(500, 500, 500))


@scene(says=("fog", "volume"), samples=4096)
def fog(on):
    ground(), world()
    material = bpy.data.materials.new("fog")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    volume = add(tree, "ShaderNodeVolumePrincipled", {"Density": 2.0, "Color": (*GREY, 1)})
    add(tree, "ShaderNodeOutputMaterial", {"Volume": volume.outputs[0]})
    if on:
        box("fog", material, 1.5, location=(0, 0, 0.9))
