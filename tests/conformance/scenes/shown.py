"""What is shown in renders, whatever the window shows."""

import bpy

from tests.conformance.parts import (
    GREY,
    RED,
    ground,
    move,
    new_collection,
    plain,
    plate,
    put,
    wall,
    world,
)
from tests.conformance.scene import scene


@scene(quick=True)
def hidden_by_the_eye(on):
    ground()
    world()
    (plate() if on else put("nothing", None)).hide_set(True)


@scene()
def off_in_viewports(on):
    ground()
    world()
    if on:
        plate().hide_viewport = True


@scene(quick=True)
def off_in_renders(on):
    ground()
    world()
    plate().hide_render = on


@scene()
def collection_off_in_renders(on):
    ground()
    world()
    move(plate(), new_collection("drafts")).users_collection[0].hide_render = on


@scene(quick=True)
def collection_off_in_viewports(on):
    ground()
    world()
    if on:
        move(plate(), new_collection("heavy")).users_collection[0].hide_viewport = True


@scene()
def collection_hidden_by_the_eye(on):
    ground()
    world()
    if on:
        move(plate(), new_collection("heavy"))
        bpy.context.view_layer.layer_collection.children["heavy"].hide_viewport = True


@scene()
def collection_excluded(on):
    ground()
    world()
    move(plate(), new_collection("drafts"))
    bpy.context.view_layer.layer_collection.children["drafts"].exclude = on


@scene(quick=True)
def view_layer_with_a_material(on):
    world()
    ground(plain("ground", GREY))
    wall(plain("wall", RED), scale=(1, 1, 1))
    if on:
        bpy.context.view_layer.material_override = plain("clay", (0.2, 0.8, 0.4))
