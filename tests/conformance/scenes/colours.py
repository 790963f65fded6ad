"""Nodes that change colours, groups and wiring."""

import bpy

from tests.conformance.parts import GREY, RED, add, ground, painted, world
from tests.conformance.scene import scene


def _changed(on, change, colour=RED):
    """The ground painted by what `change(tree, socket)` makes of a colour."""

    def result(tree):
        first = add(tree, "ShaderNodeRGB")
        first.outputs[0].default_value = (*colour, 1)
        return change(tree, first.outputs[0]) if on else first.outputs[0]

    ground(painted("ground", result))
    world()


@scene()
def colour_ramp(on):
    def colour(tree):
        position = add(tree, "ShaderNodeTexCoord").outputs["UV"]
        factor = add(tree, "ShaderNodeTexGradient", {0: position}).outputs[0]
        ramp = add(tree, "ShaderNodeValToRGB", {0: factor})
        middle = ramp.color_ramp.elements.new(0.35)
        middle.color = (0.9, 0.1, 0.1, 1)
        ramp.color_ramp.interpolation = "EASE"
        return ramp.outputs[0] if on else factor

    ground(painted("ground", colour))
    world()


@scene()
def hue_and_saturation(on):
    _changed(on, lambda tree, colour: add(
        tree, "ShaderNodeHueSaturation", {"Hue": 0.8, "Saturation": 0.6, "Color": colour}
    ).outputs[0])  # fmt: skip


@scene()
def colour_curves(on):
    def curved(tree, colour):
        node = add(tree, "ShaderNodeRGBCurve", {"Color": colour})
        node.mapping.curves[0].points[1].location = 1, 0.4
        node.mapping.curves[2].points[0].location = 0, 0.3
        node.mapping.update()
        return node.outputs[0]

    _changed(on, curved)


@scene(quick=True)
def brightness_gamma_and_inversion(on):
    def changed(tree, colour):
        inverted = add(tree, "ShaderNodeInvert", {"Color": colour}).outputs[0]
        gamma = add(tree, "ShaderNodeGamma", {"Color": inverted, "Gamma": 1.8}).outputs[0]
        return add(tree, "ShaderNodeBrightContrast", {"Color": gamma, "Contrast": -0.3}).outputs[0]

    _changed(on, changed)


def _blend(on, kind):
    def mixed(tree, colour):
        node = add(tree, "ShaderNodeMix", data_type="RGBA", blend_type=kind)
        node.inputs[0].default_value = 0.8
        tree.links.new(colour, node.inputs[6])
        node.inputs[7].default_value = (0.3, 0.8, 0.5, 1)
        return node.outputs[2]

    _changed(on, mixed, (0.7, 0.4, 0.2))


@scene()
def mix_multiply(on):
    _blend(on, "MULTIPLY")


@scene()
def mix_overlay(on):
    _blend(on, "OVERLAY")


@scene(quick=True)
def mix_difference(on):
    _blend(on, "DIFFERENCE")


@scene()
def mix_hue(on):
    _blend(on, "HUE")


@scene()
def separate_and_combine(on):
    def swapped(tree, colour):
        parts = add(tree, "ShaderNodeSeparateColor", {0: colour}).outputs
        return add(tree, "ShaderNodeCombineColor", {0: parts[2], 1: parts[1], 2: parts[0]}).outputs[
            0
        ]

    _changed(on, swapped)


@scene()
def blackbody_as_a_colour(on):
    _changed(
        on, lambda tree, colour: add(tree, "ShaderNodeBlackbody", {0: 2500.0}).outputs[0], GREY
    )


def _group(name, inner):
    """A node group of one colour that goes through `inner(tree, socket)`."""
    group = bpy.data.node_groups.new(name, "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    source = add(group, "NodeGroupInput").outputs[0]
    add(group, "NodeGroupOutput", {0: inner(group, source)})
    return group


@scene(quick=True)
def nested_groups(on):
    def inverted(tree, colour):
        return add(tree, "ShaderNodeInvert", {"Color": colour}).outputs[0]

    inner = _group("inner", inverted)

    def nested(tree, colour):
        return add(tree, "ShaderNodeGroup", {0: colour}, node_tree=inner).outputs[0]

    outer = _group("outer", nested)
    _changed(on, lambda tree, colour: add(
        tree, "ShaderNodeGroup", {0: colour}, node_tree=outer).outputs[0])  # fmt: skip


@scene(quick=True)
def muted_node(on):
    def colour(tree):
        first = add(tree, "ShaderNodeRGB")
        first.outputs[0].default_value = (*RED, 1)
        inverted = add(tree, "ShaderNodeInvert", {"Color": first.outputs[0]}, mute=on)
        return inverted.outputs[0]

    ground(painted("ground", colour))
    world()


@scene()
def reroutes(on):
    def routed(tree, colour):
        first = add(tree, "NodeReroute", {0: colour}).outputs[0]
        return add(tree, "NodeReroute", {0: first}).outputs[0]

    def result(tree):
        red = add(tree, "ShaderNodeRGB")
        red.outputs[0].default_value = (*RED, 1)
        return routed(tree, red.outputs[0])

    ground(painted("ground", result) if on else None)
    world()


@scene()
def muted_link(on):
    material = painted(
        "ground", lambda tree: add(tree, "ShaderNodeBlackbody", {0: 2500.0}).outputs[0]
    )
    for link in material.node_tree.links:
        if link.to_socket.name == "Color":
            link.is_muted = on
    ground(material)
    world()


@scene()
def value_driven_by_the_frame(on):
    material = painted("ground", lambda tree: add(tree, "ShaderNodeCombineColor").outputs[0])
    node = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeCombineColor")
    if on:
        node.inputs[1].driver_add("default_value").driver.expression = "0.1 * frame"
    node.inputs[0].default_value = 0.3
    ground(material)
    world()
    bpy.context.scene.frame_set(8)
