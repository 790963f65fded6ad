"""Whether the shaders of a material have one normal all together, as what is read of it has."""

from prt_core.blender.passes.arithmetic import link_of

# Closures whose lobes lie about a normal that is read.
_CLOSURES = {
    "BSDF_PRINCIPLED", "BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_METALLIC",
    "BSDF_GLASS",
}  # fmt: skip


class ClosureNormals:
    """Where the normals of closures come from; bump, which is left out, passes on what it got.

    Parameters
    ----------
    nodes : list of bpy.types.Node
        Of a material, those of its groups as well.
    """

    def __init__(self, nodes):
        self._closures = [n for n in nodes if n.type in _CLOSURES and not n.mute]
        self._groups = [n for n in nodes if n.type == "GROUP"]

    def differ(self):
        """Whether closures have different normals."""
        return len({self._behind(n.inputs["Normal"]) for n in self._closures}) > 1

    def coat_differs(self):
        """Whether a coat has other normals than what it lies on."""
        coated = (n for n in self._closures if n.type == "BSDF_PRINCIPLED" and _has_coat(n))
        return any(
            self._behind(n.inputs["Normal"]) != self._behind(n.inputs["Coat Normal"])
            for n in coated
        )

    def _behind(self, socket):
        """What feeds an input, as a frozen set: of a group that is there twice, two things."""
        link = link_of(socket)
        if link is None:
            return frozenset([None])
        node, output = link.from_node, link.from_socket
        if node.type == "REROUTE":
            return self._behind(node.inputs[0])
        if node.type == "BUMP":
            return self._behind(node.inputs["Normal"])
        if node.type == "GROUP_INPUT":
            given = [
                self._behind(each)
                for group in self._groups
                if group.node_tree == node.id_data
                for each in group.inputs
                if each.identifier == output.identifier
            ]
            return frozenset().union(*given)
        return frozenset([(node.as_pointer(), output.identifier)])


def _has_coat(node):
    weight = node.inputs["Coat Weight"]
    return weight.is_linked or weight.default_value > 0
