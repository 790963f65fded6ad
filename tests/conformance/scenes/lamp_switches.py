"""Which lamps shine, and where they are."""

import bpy

from tests.conformance.parts import box, ground, lamp, lamp_above, move, new_collection, put, world
from tests.conformance.scene import scene


@scene(light="lamps", quick=True)
def lamp_off_in_renders(on):
    ground()
    lamp_above("POINT")
    other = lamp("other", "POINT", (-1, -1, 0.8), 60)
    other.hide_render = on


@scene(light="lamps")
def lamp_hidden_by_the_eye(on):
    ground()
    lamp_above("POINT", 20)
    other = lamp("other", "POINT", (-1, -1, 0.8), 60)
    other.hide_set(True)
    other.hide_render = not on


@scene(light="lamps", quick=True)
def lamp_in_a_collection_off_in_renders(on):
    ground()
    lamp_above("POINT")
    other = lamp("other", "POINT", (-1, -1, 0.8), 60)
    move(other, new_collection("old lamps")).users_collection[0].hide_render = on


@scene(light="lamps", quick=True)
def lamp_in_a_collection_off_in_viewports(on):
    ground()
    lamp_above("POINT", 20)
    other = lamp("other", "POINT", (-1, -1, 0.8), 60)
    move(other, new_collection("heavy")).users_collection[0].hide_viewport = True
    other.hide_render = not on


@scene(light="lamps")
def lamp_in_an_excluded_collection(on):
    ground()
    lamp_above("POINT")
    move(lamp("other", "POINT", (-1, -1, 0.8), 60), new_collection("drafts"))
    bpy.context.view_layer.layer_collection.children["drafts"].exclude = on


@scene(light="lamps")
def instanced_lamps(on):
    ground()
    library = bpy.data.collections.new("street lamps")
    move(lamp("bulb", "POINT", (0, 0, 0), 30), library)
    for x in (-1, 1) if on else (0,):
        item = put("street lamp", None, location=(x, 0, 0.8))
        item.instance_type, item.instance_collection = "COLLECTION", library


@scene(light="lamps")
def lamp_out_of_a_library(on):
    path = f"{bpy.app.tempdir}lamps.blend"
    item = lamp_above("POINT")
    bpy.data.libraries.write(path, {item}, fake_user=True)
    bpy.data.lights.remove(item.data)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["lamp"]
    ground()
    lamp("weak", "POINT", (-1, -1, 1), 10)
    if on:
        bpy.context.scene.collection.objects.link(wanted.objects[0])


@scene(light="lamps", quick=True)
def lamp_under_a_parent(on):
    ground()
    parent = put("crane", None, location=(0.5, 0, 0), rotation=(0, 0, 1), scale=(1, 1, 2))
    item = lamp_above("POINT", location=(0.8, 0, 0.4))
    if on:
        item.parent = parent


@scene(light="lamps")
def lamp_that_moves_with_the_frame(on):
    ground()
    item = lamp_above("POINT")
    item.driver_add("location", 0).driver.expression = "0.1 * frame" if on else "-1"
    bpy.context.scene.frame_set(10)


@scene(light="all", quick=True)
def lamps_and_a_world(on):
    ground()
    world(0.5, (0.3, 0.5, 1))
    box(location=(0, 0, 0.5))
    lamp_above("SUN", 2.0 * on, rotation=(0.5, 0.6, 0), angle=0.1)


@scene(light="lamps")
def lamp_of_a_background_set(on):
    ground()
    lamp("weak", "POINT", (-1, -1, 1), 10)
    behind = bpy.data.scenes.new("set")
    move(lamp_above("POINT"), behind.collection)
    bpy.context.scene.background_set = behind if on else None
