"""Objects that are no meshes: text, curves, hair, point clouds, particles."""

import bpy

from tests.conformance.parts import (
    GREEN,
    RED,
    add,
    box,
    geometry_nodes,
    grid,
    ground,
    modifier,
    plain,
    put,
    world,
)
from tests.conformance.scene import scene


@scene(quick=True)
def text(on):
    ground()
    world()
    if on:
        data = bpy.data.curves.new("text", "FONT")
        data.body, data.size, data.extrude, data.align_x = "HIM", 2.2, 0.3, "CENTER"
        data.materials.append(plain("text", RED))
        put("text", data, location=(0, -0.8, 0.5))


@scene()
def curve_with_a_bevel(on):
    ground()
    world()
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
    ground()
    world()
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
    ground()
    world()
    if on:
        data = bpy.data.metaballs.new("drops")
        data.resolution = data.render_resolution = 0.15
        for x in (-0.5, 0.5):
            element = data.elements.new()
            element.co, element.radius = (x, 0, 0), 1.2
        data.materials.append(plain("drops", RED))
        put("drops", data, location=(0, 0, 0.8))


@scene(quick=True)
def nurbs_surface(on):
    ground()
    world()
    if on:
        bpy.ops.surface.primitive_nurbs_surface_sphere_add(radius=1.2, location=(0, 0, 0.9))
        bpy.context.object.data.materials.append(plain("drop", RED))


def _emitter():
    return grid("emitter", 4, 2, plain("soil", (0.3, 0.2, 0.1)), location=(0, 0, 0.05))


@scene(says=("emitter", "particle"))
def particle_hair(on):
    ground()
    world()
    settings = modifier(_emitter(), "PARTICLE_SYSTEM").particle_system.settings
    settings.type, settings.count, settings.hair_length = "HAIR", 300 if on else 0, 0.9
    settings.root_radius = settings.tip_radius = 8.0


@scene()
def particle_objects(on):
    ground()
    world()
    leaf = box("leaf", plain("leaf", GREEN), 0.5, location=(50, 0, 0))
    settings = modifier(_emitter(), "PARTICLE_SYSTEM").particle_system.settings
    settings.type, settings.use_advanced_hair = "HAIR", True
    settings.count, settings.render_type, settings.instance_object = 12 if on else 0, "OBJECT", leaf
    settings.particle_size = 0.4


@scene(says=("fringe", "hair"))
def hair_curves(on):
    ground()
    world()
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
    ground()
    world()
    if on:
        source = put("dust", bpy.data.meshes.new("dust"), location=(0, 0, 0.6))
        source.data.from_pydata([(x, y, 0) for x in (-1, 0, 1) for y in (-1, 0, 1)], [], [])

        def points(tree, geometry):
            cloud = add(tree, "GeometryNodeMeshToPoints", {"Mesh": geometry, "Radius": 0.4})
            paint = {"Geometry": cloud.outputs[0], "Material": plain("dust", RED)}
            return add(tree, "GeometryNodeSetMaterial", paint).outputs[0]

        geometry_nodes(source, points)
