"""Lamps of every kind, with every setting that Cycles reads."""

import math

import bpy

from tests.conformance.parts import (
    BLUE,
    GREY,
    RED,
    add,
    box,
    ground,
    lamp,
    move,
    new_collection,
    place,
    plain,
    put,
    wall,
    world,
)
from tests.conformance.scene import scene

ABOVE = (0.2, -0.1, 1.2)
LEANING = (0.3, -0.4, 0.7)


def _lamp(kind, energy=60, location=ABOVE, rotation=LEANING, scale=(1, 1, 1), **settings):
    """The lamp of most scenes, over the ground."""
    item = lamp("lamp", kind, location, energy, rotation, **settings)
    item.scale = scale
    return item


def _nodes(item, strength):
    """The lamp's nodes: an Emission of the strength or colour that `strength(tree)` gives."""
    data = item.data
    data.use_nodes = True
    tree = data.node_tree
    tree.nodes.clear()
    socket = strength(tree)
    name = "Color" if socket.type == "RGBA" else "Strength"
    shine = add(tree, "ShaderNodeEmission", {name: socket}).outputs[0]
    add(tree, "ShaderNodeOutputLight", {0: shine})
    return item


# ---- points and spots


@scene(light="lamps", quick=True)
def point_lamp(on):
    ground(), _lamp("POINT", 60 if on else 40, shadow_soft_size=0.2)
    box(size=0.5, location=(0.7, 0.6, 0.3))


@scene(light="lamps")
def point_lamp_of_no_radius(on):
    ground(), _lamp("POINT", shadow_soft_size=0.0 if on else 0.8)
    box(size=0.5, location=(0, 0, 0.3))


@scene(light="lamps")
def point_lamp_with_soft_falloff(on):
    ground()
    _lamp("POINT", location=(0, 0, 0.6), shadow_soft_size=0.5, use_soft_falloff=on)


@scene(light="lamps", quick=True)
def point_lamp_that_is_a_ball(on):
    ground()
    _lamp("POINT", location=(0, 0, 0.6), shadow_soft_size=0.5, use_soft_falloff=not on)


@scene(light="lamps")
def point_lamp_scaled(on):
    # Scale changes neither its power nor its radius.
    ground(), box(location=(0, 0, 0.55))
    radius = 0.2 if on else 0.8
    _lamp("POINT", location=(0, 0, 2.2), scale=(4, 4, 4), shadow_soft_size=radius)


@scene(light="lamps", quick=True)
def spot_lamp(on):
    ground()
    _lamp("SPOT", 200, spot_size=1.2 if on else 2.0, spot_blend=0.5, shadow_soft_size=0.05)


@scene(light="lamps")
def spot_lamp_without_blend(on):
    ground()
    _lamp("SPOT", 200, spot_size=1.4, spot_blend=0.0 if on else 1.0, shadow_soft_size=0.0)


@scene(light="lamps")
def spot_lamp_of_full_blend(on):
    ground()
    _lamp("SPOT", 200, spot_size=1.4, spot_blend=1.0 if on else 0.0, shadow_soft_size=0.1)


@scene(light="lamps")
def spot_lamp_stretched(on):
    ground()
    scale = (1, 2.5, 1) if on else (1, 1, 1)
    _lamp("SPOT", 200, scale=scale, spot_size=0.8, spot_blend=0.7, shadow_soft_size=0.05)


@scene(light="lamps")
def spot_lamp_that_is_a_ball(on):
    ground()
    ball = {"shadow_soft_size": 0.5, "use_soft_falloff": not on}
    _lamp("SPOT", 200, (0, 0, 0.7), (0, 0, 0), spot_size=2.2, spot_blend=0.6, **ball)


# ---- suns


@scene(light="lamps", quick=True)
def sun_lamp(on):
    ground(), box(location=(0, 0, 0.5))
    _lamp("SUN", 3, rotation=(0.5, 0.6, 0) if on else (0, 0, 0), angle=0.05)


@scene(light="lamps")
def sun_lamp_of_no_angle(on):
    ground(), box(location=(0, 0, 0.5))
    _lamp("SUN", 3, rotation=(0.5, 0.6, 0), angle=0.0 if on else 0.6)


@scene(light="lamps")
def sun_lamp_of_a_wide_angle(on):
    ground(), box(location=(0, 0, 0.5))
    _lamp("SUN", 3, rotation=(0.5, 0.6, 0), angle=1.2 if on else 0.0)


# ---- areas


def _area(shape, **settings):
    ground(), box(size=0.4, location=(0.4, 0.4, 0.25))
    return _lamp("AREA", **{"shape": shape, "size": 1.0} | settings)


@scene(light="lamps", quick=True)
def area_lamp_square(on):
    _area("SQUARE", size=1.0 if on else 3.0)


@scene(light="lamps")
def area_lamp_rectangle(on):
    _area("RECTANGLE" if on else "SQUARE", size=0.3, size_y=3.0)


@scene(light="lamps")
def area_lamp_disc(on):
    _area("DISK" if on else "SQUARE", size=2.5, location=(0, 0, 0.6))


@scene(light="lamps")
def area_lamp_ellipse(on):
    _area("ELLIPSE" if on else "DISK", size=0.4, size_y=3.0)


@scene(light="lamps")
def area_lamp_of_a_narrow_spread(on):
    _area("SQUARE", spread=0.5 if on else math.pi, size=0.5)


@scene(light="lamps")
def area_lamp_stretched(on):
    _area("SQUARE", scale=(0.3, 3, 1) if on else (1, 1, 1))


@scene(light="lamps")
def area_lamp_mirrored(on):
    _area("RECTANGLE", size=0.3, size_y=2, scale=(1, 1, 1 if not on else -1))


@scene(light="lamps", since=(4, 5))
def area_lamp_that_is_not_normalised(on):
    _area("SQUARE", size=2.0, energy=5, normalize=not on)


@scene(light="lamps")
def area_lamp_without_a_size(on):
    _area("SQUARE", size=0.0 if on else 2.0)


# ---- how bright, which colour


@scene(light="lamps")
def lamp_of_a_colour(on):
    ground(), _lamp("POINT", color=(1, 0.3, 0.1) if on else (1, 1, 1))


@scene(light="lamps", since=(4, 5))
def lamp_of_a_temperature(on):
    ground(), _lamp("POINT", use_temperature=on, temperature=2500.0)


@scene(light="lamps", since=(4, 5))
def lamp_of_an_exposure(on):
    ground(), _lamp("POINT", exposure=1.5 if on else 0.0)


@scene(light="lamps")
def lamp_of_negative_power(on):
    ground(), _lamp("POINT", -20 if on else 20)
    lamp("other", "SUN", (0, 0, 3), 3)


@scene(light="lamps")
def lamp_by_nodes(on):
    def strength(tree):
        value = add(tree, "ShaderNodeValue").outputs[0]
        value.default_value = 2.5 if on else 1.0
        return value

    ground(), _nodes(_lamp("POINT"), strength)


@scene(light="lamps")
def lamp_of_a_blackbody_node(on):
    def colour(tree):
        kelvin = 2500.0 if on else 6500.0
        return add(tree, "ShaderNodeBlackbody", {0: kelvin}).outputs[0]

    ground(), _nodes(_lamp("SPOT", 200, spot_size=2.0), colour)


@scene(light="lamps", says=("lamp", "nodes"))
def lamp_with_a_falloff_node(on):
    def strength(tree):
        falloff = add(tree, "ShaderNodeLightFalloff", {"Strength": 1.0, "Smooth": 0.0}).outputs
        return falloff["Constant" if on else "Quadratic"]

    ground(), _nodes(_lamp("POINT", 20), strength)


@scene(light="lamps", says=("lamp", "nodes"))
def lamp_with_an_ies_profile(on):
    profile = """IESNA:LM-63-1995
TILT=NONE
1 1000 1 5 1 1 2 0 0 0
1 1 100
0 30 60 90 180
0
100 900 50 5 0
"""

    def strength(tree):
        text = bpy.data.texts.new("profile.ies")
        text.write(profile)
        node = add(tree, "ShaderNodeTexIES", mode="INTERNAL", ies=text)
        return node.outputs[0] if on else add(tree, "ShaderNodeValue").outputs[0]

    ground(), _nodes(_lamp("POINT", 5, (0, 0, 1.2), (0, 0, 0)), strength)


@scene(light="lamps", says=("lamp", "nodes"))
def lamp_with_a_pattern(on):
    def colour(tree):
        normal = add(tree, "ShaderNodeTexCoord").outputs["Normal"]
        checker = {"Vector": normal, "Scale": 3.0}
        checker |= {"Color1": (1, 0, 0, 1), "Color2": (0, 0, 1, 1)}
        plain_colour = add(tree, "ShaderNodeRGB").outputs[0]
        return add(tree, "ShaderNodeTexChecker", checker).outputs[0] if on else plain_colour

    ground(), _nodes(_lamp("SPOT", 200, spot_size=2.0, shadow_soft_size=0.0), colour)


# ---- which lamps shine


@scene(light="lamps", quick=True)
def lamp_off_in_renders(on):
    ground(), _lamp("POINT")
    other = lamp("other", "POINT", (-1, -1, 0.8), 60)
    other.hide_render = on


@scene(light="lamps")
def lamp_hidden_by_the_eye(on):
    ground(), _lamp("POINT", 20)
    other = lamp("other", "POINT", (-1, -1, 0.8), 60)
    other.hide_set(True)
    other.hide_render = not on


@scene(light="lamps", quick=True)
def lamp_in_a_collection_off_in_renders(on):
    ground(), _lamp("POINT")
    other = lamp("other", "POINT", (-1, -1, 0.8), 60)
    move(other, new_collection("old lamps")).users_collection[0].hide_render = on


@scene(light="lamps")
def lamp_in_a_collection_off_in_viewports(on):
    ground(), _lamp("POINT", 20)
    other = lamp("other", "POINT", (-1, -1, 0.8), 60)
    move(other, new_collection("heavy")).users_collection[0].hide_viewport = True
    other.hide_render = not on


@scene(light="lamps")
def lamp_in_an_excluded_collection(on):
    ground(), _lamp("POINT")
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
    item = _lamp("POINT")
    bpy.data.libraries.write(path, {item}, fake_user=True)
    bpy.data.lights.remove(item.data)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["lamp"]
    ground(), lamp("weak", "POINT", (-1, -1, 1), 10)
    if on:
        bpy.context.scene.collection.objects.link(wanted.objects[0])


@scene(light="lamps")
def lamp_under_a_parent(on):
    ground()
    parent = put("crane", None, location=(0.5, 0, 0), rotation=(0, 0, 1), scale=(1, 1, 2))
    item = _lamp("POINT", location=(0.8, 0, 0.4))
    if on:
        item.parent = parent


@scene(light="lamps")
def lamp_that_moves_with_the_frame(on):
    ground()
    item = _lamp("POINT")
    item.driver_add("location", 0).driver.expression = "0.1 * frame" if on else "-1"
    bpy.context.scene.frame_set(10)


@scene(light="all", quick=True)
def lamps_and_a_world(on):
    ground(), world(0.5, (0.3, 0.5, 1)), box(location=(0, 0, 0.5))
    _lamp("SUN", 2.0 * on, rotation=(0.5, 0.6, 0), angle=0.1)


# ---- light and shadow linking, shadows


def _linked(on, way, state, item):
    """A lamp over the ground and a box, whose linking includes or excludes `item`."""
    bulb = _lamp("POINT", shadow_soft_size=0.1)
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
    bulb = _lamp("POINT", shadow_soft_size=0.1)
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
    ground(), box("other box", size=0.5, location=(0.9, 0.6, 0.6))
    _linked(on, "blocker", "INCLUDE", box(size=0.5, location=(-0.5, -0.5, 0.6)))


@scene(light="all", says=("panel", "linking"), samples=4096)
def light_linking_of_a_panel_that_shines(on):
    from tests.conformance.parts import emission, sheet

    floor = ground()
    wall(), world(0.2), _lamp("POINT", 5)
    panel = sheet("panel", emission("panel", (1, 1, 1), 5), 1, location=(0, 0, 1.5))
    place(panel, (0, 0, 1.5), (math.pi, 0, 0))
    if on:
        collection = bpy.data.collections.new("linking")
        collection.objects.link(floor)
        collection.collection_objects[0].light_linking.link_state = "EXCLUDE"
        panel.light_linking.receiver_collection = collection


@scene(light="lamps")
def lamp_without_shadows(on):
    ground(), box(size=0.6, location=(0, 0, 0.6))
    _lamp("POINT", shadow_soft_size=0.1, use_shadow=not on)


@scene(light="lamps")
def lamp_without_shadows_in_cycles(on):
    ground(), box(size=0.6, location=(0, 0, 0.6))
    data = _lamp("SPOT", 200, spot_size=2.0, shadow_soft_size=0.1).data
    if hasattr(data.cycles, "cast_shadow"):
        data.cycles.cast_shadow = not on
    else:
        data.use_shadow = not on


@scene(light="lamps", says=("lamp", "bounces"))
def lamp_of_one_bounce(on):
    ground(plain("ground", GREY)), wall(plain("wall", RED), scale=(1, 1, 1), location=(-2, 0, 2))
    _lamp("POINT", location=(-1, 0, 1)).data.cycles.max_bounces = 0 if on else 1024


@scene(light="lamps")
def lamp_that_diffuse_rays_do_not_see(on):
    ground(plain("ground", BLUE)), lamp("weak", "POINT", (-1, -1, 1), 10)
    _lamp("POINT").visible_diffuse = not on


@scene(light="lamps")
def lamp_that_the_camera_does_not_see(on):
    # What bounces off surfaces shines as ever.
    ground()
    item = _lamp("POINT")
    item.visible_camera, item.hide_render = False, not on
    lamp("weak", "POINT", (-1, -1, 1), 10)


@scene(light="all")
def portal(on):
    # A portal guides Cycles' rays; it does not shine.
    ground(), world(0.3), _lamp("POINT", 20)
    item = lamp("portal", "AREA", (0.5, 0.5, 1), 50, size=1)
    item.data.cycles.is_portal = on
