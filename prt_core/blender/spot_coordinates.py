"""The UV coordinates of a spot lamp, for nodes of a point lamp that stands in for it.

Over the disc that its cone cuts out Cycles lays the unit square; a point lamp has its sphere there.
"""

import numpy as np

from prt_core.blender.node_trees import all_nodes

# Outputs that give them, by the types of nodes.
_GIVE = {"TEX_COORD": "UV", "NEW_GEOMETRY": "Parametric"}


def with_spot_coordinates(tree, light, scale):
    """Change a tree, and its groups, to find the coordinates of a spot lamp.

    Parameters
    ----------
    tree : bpy.types.NodeTree
        Copies already, groups as well.
    light : bpy.types.Light
    scale : (3,) float
        Of the lamp's axes.
    """
    half = np.tan(light.spot_size / 2)
    # Normals in a lamp's space grow by its scale, directions shrink by it.
    stretch = (scale[2] / np.asarray(scale[:2])) ** 2 * (-0.5 / half)
    for node in list(all_nodes(tree)):
        ends = [
            link.to_socket
            for output in node.outputs if output.name == _GIVE.get(node.type)
            for link in output.links if not link.is_muted
        ]  # fmt: skip
        if node.type == "TEX_IMAGE" and not node.inputs["Vector"].is_linked:
            ends.append(node.inputs["Vector"])
        if ends:
            square = _square(node.id_data, stretch)
            for end in ends:
                node.id_data.links.new(square, end)


def _square(tree, stretch):
    """The socket of a vector: where in the square the light leaves to."""

    def new(kind, *inputs, operation=None):
        node = tree.nodes.new(f"ShaderNode{kind}")
        if operation:
            node.operation = operation
        for socket, given in zip(node.inputs, inputs, strict=False):
            if hasattr(given, "links"):
                tree.links.new(given, socket)
            else:
                socket.default_value = given
        return node.outputs

    way = new("TexCoord")["Normal"]
    depth = new("SeparateXYZ", way)["Z"]
    ahead = new("CombineXYZ", depth, depth, depth)[0]
    flat = new("VectorMath", way, ahead, operation="DIVIDE")[0]
    return new("VectorMath", flat, (*stretch, 0), (0.5, 0.5, 0), operation="MULTIPLY_ADD")[0]
