"""Light and shadow linking, lamps without shadows or bounces, ray visibility of lamps."""

import math

import bpy

from tests.conformance.parts import (
    BLUE,
    GREY,
    RED,
    box,
    emission,
    ground,
    lamp,
    lamp_above,
    move,
    place,
    plain,
    plate,
    put,
    sheet,
    wall,
    world,
)
from tests.conformance.scene import scene


def _linked(on, way, state, item):
    """A lamp over the ground and a box, whose linking includes or excludes `item`."""
    bulb = lamp_above("POINT", shadow_soft_size=0.1)
    lamp("weak", "POINT", (-1, -1, 1), 10)
    if on:
        collection = bpy.data.collections.new("linking")
        collection.objects.link(item)
        collection.collection_objects[0].light_linking.link_state = state
        setattr(bulb.light_linking, f"{way}_collection", collection)


@scene(light="lamps", quick=True)
def light_linking_includes_the_wall(on):
    ground()
    _linked(on, "receiver", "INCLUDE", wall())


@scene(light="lamps")
def light_linking_excludes_the_ground(on):
    wall()
    _linked(on, "receiver", "EXCLUDE", ground())


@scene(light="lamps")
def light_linking_by_a_nested_collection(on):
    floor, panel = ground(), wall()
    bulb = lamp_above("POINT", shadow_soft_size=0.1)
    lamp("weak", "POINT", (-1, -1, 1), 10)
    if on:
        outer, inner = (bpy.data.collections.new(name) for name in ("outer", "inner"))
        outer.children.link(inner)
        inner.objects.link(panel)
        outer.objects.link(floor)
        outer.collection_objects[0].light_linking.link_state = "EXCLUDE"
        bulb.light_linking.receiver_collection = outer


@scene(light="lamps", quick=True)
def shadow_linking_excludes_the_box(on):
    ground()
    _linked(on, "blocker", "EXCLUDE", box(size=0.6, location=(0, 0, 0.6)))


@scene(light="lamps")
def shadow_linking_includes_one_box(on):
    ground()
    box("other box", size=0.5, location=(0.9, 0.6, 0.6))
    _linked(on, "blocker", "INCLUDE", box(size=0.5, location=(-0.5, -0.5, 0.6)))


@scene(light="all", says=("panel", "linking"), samples=4096)
def light_linking_of_a_panel_that_shines(on):
    floor = ground()
    wall()
    world(0.2)
    lamp_above("POINT", 5)
    panel = sheet("panel", emission("panel", (1, 1, 1), 5), 1, location=(0, 0, 1.5))
    place(panel, (0, 0, 1.5), (math.pi, 0, 0))
    if on:
        collection = bpy.data.collections.new("linking")
        collection.objects.link(floor)
        collection.collection_objects[0].light_linking.link_state = "EXCLUDE"
        panel.light_linking.receiver_collection = collection


@scene(light="lamps", quick=True)
def lamp_without_shadows(on):
    ground()
    box(size=0.6, location=(0, 0, 0.6))
    lamp_above("POINT", shadow_soft_size=0.1, use_shadow=not on)


@scene(light="lamps")
def lamp_without_shadows_in_cycles(on):
    ground()
    box(size=0.6, location=(0, 0, 0.6))
    data = lamp_above("SPOT", 200, spot_size=2.0, shadow_soft_size=0.1).data
    if hasattr(data.cycles, "cast_shadow"):
        data.cycles.cast_shadow = not on
    else:
        data.use_shadow = not on


@scene(light="lamps", says=("lamp", "bounces"))
def lamp_of_one_bounce(on):
    ground(plain("ground", GREY))
    wall(plain("wall", RED), scale=(1, 1, 1), location=(-2, 0, 2))
    lamp_above("POINT", location=(-1, 0, 1)).data.cycles.max_bounces = 0 if on else 1024


@scene(light="lamps")
def lamp_that_diffuse_rays_do_not_see(on):
    ground(plain("ground", BLUE))
    lamp("weak", "POINT", (-1, -1, 1), 10)
    lamp_above("POINT").visible_diffuse = not on


@scene(light="lamps")
def lamp_that_the_camera_does_not_see(on):
    # What bounces off surfaces shines as ever.
    ground()
    item = lamp_above("POINT")
    item.visible_camera, item.hide_render = False, not on
    lamp("weak", "POINT", (-1, -1, 1), 10)


@scene(light="all")
def portal(on):
    # A portal guides Cycles' rays; it does not shine.
    ground()
    world(0.3)
    lamp_above("POINT", 20)
    item = lamp("portal", "AREA", (0.5, 0.5, 1), 50, size=1)
    item.data.cycles.is_portal = on


@scene(light="lamps")
def shadow_linking_of_an_instanced_lamp(on):
    ground()
    slab, bulb = plate(size=1), lamp_above("POINT", location=(0, 0, 0))
    library = bpy.data.collections.new("street lamps")
    move(bulb, library)
    item = put("street lamp", None, location=(0.4, 0.2, 1.5))
    item.instance_type, item.instance_collection = "COLLECTION", library
    if on:
        # Of the instance it counts for nothing.
        for owner, linked in ((bulb, slab), (item, bpy.data.objects["ground"])):
            collection = bpy.data.collections.new("linking")
            collection.objects.link(linked)
            collection.collection_objects[0].light_linking.link_state = "EXCLUDE"
            way = "blocker" if owner is bulb else "receiver"
            setattr(owner.light_linking, f"{way}_collection", collection)
