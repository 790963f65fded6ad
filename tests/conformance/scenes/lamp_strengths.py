"""How bright a lamp is and in which colour: settings and nodes."""

import bpy

from tests.conformance.parts import (
    BESIDE,
    add,
    ground,
    image,
    lamp,
    lamp_above,
    move,
    patches,
    plain,
    put,
    wall,
)
from tests.conformance.scene import scene

# Since then lamps of Cycles know whose they are; before, what nodes ask of an object is 0.
_OBJECTS = (4, 4)


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


@scene(light="lamps")
def lamp_of_a_colour(on):
    ground()
    lamp_above("POINT", color=(1, 0.3, 0.1) if on else (1, 1, 1))


@scene(light="lamps", since=(4, 5))
def lamp_of_a_temperature(on):
    ground()
    lamp_above("POINT", use_temperature=on, temperature=2500.0)


@scene(light="lamps", since=(4, 5))
def lamp_of_an_exposure(on):
    ground()
    lamp_above("POINT", exposure=1.5 if on else 0.0)


@scene(light="lamps")
def lamp_of_negative_power(on):
    ground()
    lamp_above("POINT", -20 if on else 20)
    lamp("other", "SUN", (0, 0, 3), 3)


@scene(light="lamps")
def lamp_by_nodes(on):
    def strength(tree):
        value = add(tree, "ShaderNodeValue").outputs[0]
        value.default_value = 2.5 if on else 1.0
        return value

    ground()
    _nodes(lamp_above("POINT"), strength)


@scene(light="lamps", quick=True)
def lamp_of_a_blackbody_node(on):
    def colour(tree):
        kelvin = 2500.0 if on else 6500.0
        return add(tree, "ShaderNodeBlackbody", {0: kelvin}).outputs[0]

    ground()
    _nodes(lamp_above("SPOT", 200, spot_size=2.0), colour)


@scene(light="lamps", says=("lamp", "nodes"))
def lamp_with_a_falloff_node(on):
    def strength(tree):
        falloff = add(tree, "ShaderNodeLightFalloff", {"Strength": 1.0, "Smooth": 0.0}).outputs
        return falloff["Constant" if on else "Quadratic"]

    ground()
    _nodes(lamp_above("POINT", 20), strength)


@scene(light="lamps", says=("lamp", "nodes"), since=(5, 0))
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

    ground()
    _nodes(lamp_above("POINT", 5, (0, 0, 1.2), (0, 0, 0)), strength)


@scene(light="lamps", says=("lamp", "nodes"))
def lamp_with_a_pattern(on):
    def colour(tree):
        normal = add(tree, "ShaderNodeTexCoord").outputs["Normal"]
        checker = {"Vector": normal, "Scale": 3.0}
        checker |= {"Color1": (1, 0, 0, 1), "Color2": (0, 0, 1, 1)}
        plain_colour = add(tree, "ShaderNodeRGB").outputs[0]
        return add(tree, "ShaderNodeTexChecker", checker).outputs[0] if on else plain_colour

    ground()
    _nodes(lamp_above("SPOT", 200, spot_size=2.0, shadow_soft_size=0.0), colour)


@scene(light="lamps")
def spot_lamp_that_projects_an_image(on):
    def colour(tree):
        kind = "ShaderNodeTexImage" if on else "ShaderNodeRGB"
        picture = {"image": image("slide", patches()), "interpolation": "Cubic"} if on else {}
        return add(tree, kind, **picture).outputs[0]

    ground(cells=24)
    _nodes(lamp_above("SPOT", 200, (0, 0, 1.8), (0.2, 0, 0.3), (1, 1.4, 1), spot_size=1.4), colour)


@scene(light="lamps", says=("lamp", "place to place"))
def ball_of_noise(on):
    def colour(tree):
        place = add(tree, "ShaderNodeNewGeometry").outputs["Position" if on else "Normal"]
        return add(tree, "ShaderNodeTexNoise", {"Vector": place, "Scale": 3.0}).outputs["Color"]

    ground()
    _nodes(lamp_above("POINT", location=(0, 0, 1.6), shadow_soft_size=0.4), colour)


# ---- what nodes ask of the lamp's object


def _value(kind, output, **settings):
    """The output of a node of this kind, as a function of a tree."""
    return lambda tree: add(tree, kind, **settings).outputs[output]


def _property(of):
    return _value("ShaderNodeAttribute", "Fac", attribute_type=of, attribute_name="dimmed")


def _two(bulb):
    """Two instances of a collection of the lamp."""
    bulb.location = 0, 0, 0
    library = bpy.data.collections.new("street lamps")
    move(bulb, library)
    for x in (-1, 1):
        item = put(f"street lamp {x}", None, location=(x, 0, 1))
        item.instance_type, item.instance_collection = "COLLECTION", library
        yield item


@scene(light="lamps", quick=True, since=_OBJECTS)
def lamp_in_the_colour_of_its_object(on):
    ground()
    bulb = _nodes(lamp_above("POINT"), _value("ShaderNodeObjectInfo", "Color"))
    bulb.color = (1, 0.3, 0.1, 1) if on else (1, 1, 1, 1)


@scene(light="lamps", since=_OBJECTS)
def lamp_dimmed_by_a_property(on):
    ground()
    bulb = _nodes(lamp_above("POINT"), _property("OBJECT"))
    bulb["dimmed"] = 0.3 if on else 1.0


@scene(light="lamps")
def lamp_dimmed_by_a_property_of_the_view_layer(on):
    ground()
    _nodes(lamp_above("POINT"), _property("VIEW_LAYER"))
    bpy.context.view_layer["dimmed"] = 0.3 if on else 1.0


@scene(light="lamps", quick=True, since=_OBJECTS)
def instanced_lamps_of_random_strengths(on):
    ground()
    kind, output = ("ShaderNodeObjectInfo", "Random") if on else ("ShaderNodeValue", 0)
    list(_two(_nodes(lamp_above("POINT"), _value(kind, output))))


@scene(light="lamps", since=_OBJECTS)
def instanced_lamps_dimmed_by_their_instancers(on):
    ground()
    for item in _two(_nodes(lamp_above("POINT"), _property("INSTANCER"))):
        item["dimmed"] = 0.2 if on and item.location.x > 0 else 1.0


@scene(light="lamps", says=("lamp", "count bounces"), samples=4096, quick=True)
def lamp_that_counts_bounces(on):
    ground()
    wall(plain("wall", (0.95, 0.95, 0.95)), **BESIDE)
    kind, output = ("ShaderNodeLightPath", "Ray Depth") if on else ("ShaderNodeValue", 0)
    _nodes(lamp_above("POINT"), _value(kind, output))
