"""Who sees whom: ray visibility of objects, lamps and worlds, holdouts, shadow catchers."""

import bpy

from tests.conformance.parts import (
    BESIDE,
    GREY,
    RED,
    box,
    ground,
    lamp,
    move,
    new_collection,
    plain,
    plate,
    shader,
    wall,
    world,
)
from tests.conformance.scene import scene


def _layer(name):
    return bpy.context.view_layer.layer_collection.children[name]


def _lamp():
    lamp("lamp", "POINT", (0.2, -0.1, 1.6), 60, shadow_soft_size=0.1)


@scene(quick=True)
def object_that_the_camera_does_not_see(on):
    ground()
    world()
    item = plate()
    item.visible_camera, item.hide_render = False, not on


@scene(quick=True)
def object_that_diffuse_rays_do_not_see(on):
    ground()
    world()
    wall(**BESIDE).visible_diffuse = not on


@scene(light="lamps", quick=True)
def object_that_diffuse_rays_do_not_see_under_a_lamp(on):
    ground()
    _lamp()
    wall(**BESIDE).visible_diffuse = not on


@scene(light="lamps")
def shadow_of_what_diffuse_rays_do_not_see(on):
    ground()
    _lamp()
    item = plate(size=1)
    item.visible_diffuse, item.hide_render = False, not on


@scene()
def object_without_a_shadow_under_a_sky(on):
    ground()
    world()
    plate().visible_shadow = False
    if not on:
        bpy.data.objects["plate"].hide_render = True


@scene(light="lamps", quick=True)
def object_without_a_shadow_under_a_lamp(on):
    ground()
    _lamp()
    plate(size=1).visible_shadow = not on


@scene(light="lamps", quick=True)
def object_without_a_shadow_under_a_sun(on):
    ground()
    box(location=(0, 0, 0.6))
    lamp("sun", "SUN", (0, 0, 3), 3, rotation=(0.5, 0.3, 0))
    bpy.data.objects["box"].visible_shadow = not on


@scene()
def object_that_glossy_rays_do_not_see(on):
    ground()
    world()
    item = plate()
    item.visible_glossy = item.visible_transmission = item.visible_volume_scatter = False
    item.hide_render = not on


@scene()
def object_that_nobody_sees(on):
    ground()
    world()
    item = plate()
    if on:
        item.visible_camera = item.visible_diffuse = item.visible_glossy = False
        item.visible_transmission = item.visible_shadow = item.visible_volume_scatter = False


@scene(targets=("wall",))
def hidden_object_that_is_looked_at(on):
    # What diffuse rays do not see is lit as ever itself.
    ground(plain("ground", (0.2, 0.8, 0.2) if on else (0, 0, 0)))
    world()
    wall(plain("wall", GREY), **BESIDE).visible_diffuse = False


@scene(quick=True)
def holdout_object(on):
    # Only for the camera a hole; rays of light meet it.
    ground()
    world()
    item = wall(**BESIDE)
    item.is_holdout, item.hide_render = True, not on


@scene()
def holdout_collection(on):
    ground()
    world()
    item = move(wall(**BESIDE), new_collection("masks"))
    _layer("masks").holdout, item.hide_render = True, not on


@scene()
def holdout_shader(on):
    ground()
    world()
    wall(shader("wall", "ShaderNodeHoldout") if on else plain("wall", RED), **BESIDE)


@scene()
def collection_of_indirect_light_only(on):
    ground()
    world()
    item = move(plate(), new_collection("reflectors"))
    _layer("reflectors").indirect_only, item.hide_render = True, not on


@scene(quick=True)
def shadow_catcher(on):
    ground()
    world()
    item = wall(**BESIDE)
    item.is_shadow_catcher, item.hide_render = True, not on


@scene(light="all")
def world_that_diffuse_rays_do_not_see(on):
    ground()
    world(1.0, (0.3, 0.5, 1.0))
    _lamp()
    wall()
    bpy.context.scene.world.cycles_visibility.diffuse = not on


@scene(light="all")
def world_that_the_camera_does_not_see(on):
    ground()
    world(1.0 if on else 0.0, (0.3, 0.5, 1.0))
    _lamp()
    wall()
    bpy.context.scene.world.cycles_visibility.camera = False


@scene()
def instances_that_cast_no_shadow(on):
    ground()
    world()
    library = bpy.data.collections.new("library")
    item = move(plate(), library)
    item.visible_shadow = item.visible_diffuse = not on
    holder = bpy.data.objects.new("holder", None)
    holder.instance_type, holder.instance_collection = "COLLECTION", library
    bpy.context.scene.collection.objects.link(holder)


@scene()
def film_is_transparent(on):
    # Only the picture's background goes.
    ground()
    world(1.0 if on else 0.0)
    wall()
    bpy.context.scene.render.film_transparent = True


@scene(light="lamps")
def caustics_are_off(on):
    # Diffuse light has none.
    ground()
    _lamp()
    item = wall(**BESIDE)
    bpy.context.scene.cycles.caustics_reflective = False
    item.hide_render = not on
