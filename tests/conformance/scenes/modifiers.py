"""Modifiers as renders have them, shape keys, drivers."""

import bpy
from mathutils import Matrix

from tests.conformance.parts import (
    RED,
    ball,
    box,
    ground,
    modifier,
    plain,
    plate,
    put,
    sheet,
    world,
)
from tests.conformance.scene import scene

UP = {"location": (0, 0, 1), "size": 1.6}


@scene(quick=True)
def subdivision_in_renders(on):
    ground()
    world()
    modifier(box(**UP), "SUBSURF", levels=0, render_levels=3 if on else 0)


@scene(quick=True)
def multires_in_renders(on):
    ground()
    world()
    item = box(**UP)
    bpy.context.view_layer.objects.active = item
    detail = modifier(item, "MULTIRES")
    for _ in range(3):
        bpy.ops.object.multires_subdivide(modifier=detail.name)
    detail.levels, detail.render_levels = 0, 3 if on else 0


@scene(quick=True)
def array_in_renders(on):
    ground()
    world()
    array = modifier(box(size=0.5, location=(-1.5, 0, 0.3)), "ARRAY", count=5)
    array.relative_offset_displace = 1.3, 0, 0
    array.show_viewport, array.show_render = False, on


@scene()
def array_in_the_viewport_only(on):
    ground()
    world()
    array = modifier(box(size=0.5, location=(-1.5, 0, 0.3)), "ARRAY", count=5)
    array.relative_offset_displace = 1.3, 0, 0
    array.show_render = not on


@scene()
def mirror_modifier(on):
    ground()
    world()
    item = box(size=0.8, location=(0, 0, 0.5))
    item.data.transform(Matrix.Translation((-1.2, 0, 0)))
    modifier(item, "MIRROR", show_viewport=False, show_render=on)


@scene()
def solidify_modifier(on):
    ground()
    world()
    modifier(
        sheet("plate", plain("plate", RED), 1, location=(0, 0, 1.2)), "SOLIDIFY",
        thickness=1.1, offset=-1, show_viewport=False, show_render=on,
    )  # fmt: skip


@scene(quick=True)
def bevel_modifier(on):
    ground()
    world()
    modifier(
        box(**UP), "BEVEL", width=0.7, segments=3, show_viewport=False, show_render=on
    )  # fmt: skip


@scene()
def decimate_in_renders(on):
    ground()
    world()
    item = ball("ball", plain("ball", RED), 0.9, location=(0, 0, 0.95))
    modifier(item, "DECIMATE", ratio=0.01, show_viewport=False, show_render=on)


@scene()
def boolean_with_a_hidden_cutter(on):
    ground()
    world()
    item, cutter = box(size=1.8, location=(0, 0, 1)), box("cutter", location=(0, 0, 0.3))
    cutter.scale = 3, 3, 1.8
    cutter.hide_render = True
    if on:
        modifier(item, "BOOLEAN", object=cutter, solver="EXACT")


@scene()
def wireframe_modifier(on):
    ground()
    world()
    modifier(box(**UP), "WIREFRAME", thickness=0.2, show_viewport=False, show_render=on)


@scene(quick=True)
def render_simplify(on):
    ground()
    world()
    modifier(box(**UP), "SUBSURF", levels=3, render_levels=3)
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision_render = on, 0


@scene()
def armature_pose(on):
    ground()
    world()
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
    ground()
    world()
    item = box(size=0.8, location=(0, 0, 0.6))
    cage = put("cage", bpy.data.lattices.new("cage"), location=(0, 0, 0.6), scale=(1, 1, 1))
    modifier(item, "LATTICE", object=cage)
    if on:
        for point in cage.data.points:
            point.co_deform = [c * f for c, f in zip(point.co, (2.4, 2.4, 0.6), strict=True)]


@scene(quick=True)
def shape_key(on):
    ground()
    world()
    item = plate(location=(0, 0, 0.1))
    item.shape_key_add(name="Basis")
    key = item.shape_key_add(name="up")
    for point in key.data:
        point.co.z += 0.8
    key.value = float(on)


@scene()
def driven_by_the_frame(on):
    ground()
    world()
    item = plate()
    driver = item.driver_add("location", 2).driver
    driver.expression = "0.1 * frame" if on else "0.1"
    bpy.context.scene.frame_set(9)
