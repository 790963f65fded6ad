"""Arithmetic by a tree's nodes: what is the same everywhere is worked out at once.

A value is a number, three of them (an array), or the output socket of a node of the tree.
"""

import bpy
import numpy as np

# Of a colour, how much each channel counts in its mean.
_THIRDS = np.full(3, 1 / 3)
_SCALARS = {
    "ADD": np.add, "SUBTRACT": np.subtract, "MULTIPLY": np.multiply, "MAXIMUM": np.maximum,
    "MINIMUM": np.minimum, "GREATER_THAN": lambda a, b: float(a > b),
    # As Blender divides: by nothing gives nothing.
    "DIVIDE": lambda a, b: np.divide(a, b, np.zeros(np.shape(a)), where=np.asarray(b) != 0),
}  # fmt: skip


class Arithmetic:
    """Sums and products of values in a tree, whose nodes are made as they are needed.

    Parameters
    ----------
    tree : bpy.types.NodeTree
        Not the user's own: nodes are left in it.
    """

    def __init__(self, tree):
        self.tree = tree

    def of(self, socket):
        """What arrives at an input socket."""
        link = link_of(socket)
        if link is not None:
            return link.from_socket
        value = socket.default_value
        return np.array(value[:3], np.float64) if hasattr(value, "__len__") else float(value)

    def scalar(self, name, one, two):
        """A number: the operation of a Math node by its `name`."""
        if not (is_socket(one) or is_socket(two)):
            return float(_SCALARS[name](one, two))
        return self._node("ShaderNodeMath", name, one, two).outputs[0]

    def vector(self, name, one, two):
        """Three numbers: the operation of a Vector Math node; numbers count for all three."""
        if not (is_socket(one) or is_socket(two)):
            one, two = (np.broadcast_to(np.asarray(v, np.float64), 3) for v in (one, two))
            return np.cross(one, two) if name == "CROSS_PRODUCT" else _SCALARS[name](one, two)
        return self._node("ShaderNodeVectorMath", name, one, two).outputs[0]

    def times(self, one, two):
        """The product of a number and a number."""
        if _is(one, 0) or _is(two, 0):
            return 0.0
        if _is(one, 1) or _is(two, 1):
            return two if _is(one, 1) else one
        return self.scalar("MULTIPLY", one, two)

    def scaled(self, vector, number):
        """The product of three numbers and one, or three."""
        if _is(vector, 0) or _is(number, 0):
            return np.zeros(3)
        if _is(number, 1):
            return vector
        return self.vector("MULTIPLY", vector, number)

    def left(self, number):
        """What is left of 1."""
        return self.scalar("SUBTRACT", 1.0, number)

    def saturated(self, number):
        """A number between 0 and 1."""
        if not is_socket(number):
            return min(max(number, 0.0), 1.0)
        node = self._node("ShaderNodeMath", "ADD", number, 0.0)
        node.use_clamp = True
        return node.outputs[0]

    def saturated_colour(self, colour):
        """Three numbers between 0 and 1."""
        return self.vector("MINIMUM", self.vector("MAXIMUM", colour, 0.0), 1.0)

    def sum(self, one, two):
        """The sum of three numbers and three."""
        if _is(one, 0) or _is(two, 0):
            return two if _is(one, 0) else one
        return self.vector("ADD", one, two)

    def mixed(self, share, one, two):
        """Between `one` and `two`, three numbers each; `share` is that of the second."""
        if _is(one, 0):
            return self.scaled(two, share)
        if _is(two, 0):
            return self.scaled(one, self.left(share))
        if not is_socket(share):
            return self.sum(self.scaled(one, 1 - share), self.scaled(two, share))
        return self.sum(self.scaled(one, self.left(share)), self.scaled(two, share))

    def mean(self, colour):
        """The mean of three numbers."""
        if not is_socket(colour):
            return float(np.mean(colour))
        return self._node("ShaderNodeVectorMath", "DOT_PRODUCT", colour, _THIRDS).outputs["Value"]

    def largest(self, colour):
        """The largest of three numbers."""
        if not is_socket(colour):
            return float(np.max(colour))
        apart = self.tree.nodes.new("ShaderNodeSeparateXYZ")
        self.tree.links.new(colour, apart.inputs[0])
        red, green, blue = apart.outputs
        return self.scalar("MAXIMUM", self.scalar("MAXIMUM", red, green), blue)

    def together(self, *numbers):
        """Three numbers as one value."""
        if not any(is_socket(number) for number in numbers):
            return np.array(numbers, np.float64)
        node = self.tree.nodes.new("ShaderNodeCombineXYZ")
        for number, socket in zip(numbers, node.inputs, strict=True):
            self.join(number, socket)
        return node.outputs[0]

    def turned(self, vector, axis, turns):
        """A vector turned about an axis, by whole turns."""
        if _is(turns, 0):
            return vector
        node = self.tree.nodes.new("ShaderNodeVectorRotate")
        node.rotation_type = "AXIS_ANGLE"
        for name, value in (("Vector", vector), ("Axis", axis)):
            self.join(value, node.inputs[name])
        self.join(self.times(turns, 2 * np.pi), node.inputs["Angle"])
        return node.outputs[0]

    def geometry(self, name):
        """An output of a Geometry node."""
        return self.tree.nodes.new("ShaderNodeNewGeometry").outputs[name]

    def join(self, value, socket):
        """Let an input socket have a value."""
        if is_socket(value):
            self.tree.links.new(value, socket)
        elif hasattr(socket.default_value, "__len__"):
            socket.default_value[:3] = np.broadcast_to(np.asarray(value, np.float64), 3)
        else:
            socket.default_value = value

    def _node(self, kind, operation, one, two):
        node = self.tree.nodes.new(kind)
        node.operation = operation
        self.join(one, node.inputs[0])
        self.join(two, node.inputs[1])
        return node


def is_socket(value):
    """Whether a value is known to Cycles only."""
    return isinstance(value, bpy.types.NodeSocket)


def link_of(socket):
    """The link that feeds an input socket; None where nothing does."""
    for link in socket.links if socket.is_linked else ():
        if link.is_valid and not link.is_muted:
            return link
    return None


def _is(value, number):
    """Whether a value is known to be a number everywhere."""
    return not is_socket(value) and bool(np.all(np.asarray(value) == number))
