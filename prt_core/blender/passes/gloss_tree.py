"""Makes a material tell Cycles what its closures reflect: sums over them, in passes of their own.

The shaders of a tree are walked from its output: what a closure reflects (`closures.py`) is mixed
and added as its shaders are. A sum that crosses the border of a group takes a socket of its own.
"""

from prt_core.blender.passes.arithmetic import Arithmetic, is_socket, link_of
from prt_core.blender.passes.closures import CLOSURES, Sums, as_dielectric

# Names of the passes begin with it.
PREFIX = "prt gloss "


def add_gloss_outputs(tree, keep):
    """Let a material's tree write what its closures reflect.

    Parameters
    ----------
    tree : bpy.types.NodeTree
        Not the user's own: nodes are left in it, and its groups are replaced by copies.
    keep : callable(block)
        Told of each copy of a group, to be removed afterwards.

    Returns
    -------
    set of str
        Which planes it writes, of `PLANES`.
    """
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return set()
    walk = _Walk(tree, keep)
    sums = walk.behind(output.inputs["Surface"])
    for name, value in sums.items():
        node = tree.nodes.new("ShaderNodeOutputAOV")
        node.aov_name = PREFIX + name
        if not is_socket(value):
            # A colour of a node's own cannot be negative.
            constant = tree.nodes.new("ShaderNodeCombineXYZ")
            for number, socket in zip(value, constant.inputs, strict=True):
                socket.default_value = number
            value = constant.outputs[0]
        tree.links.new(value, node.inputs["Color"])
    return set(sums)


class _Walk:
    """The shaders of one tree.

    Parameters
    ----------
    tree : bpy.types.NodeTree
    keep : callable(block)
    outer : (_Walk, bpy.types.Node), optional
        Where it is the tree of a group: the tree that has the group, and its node there.
    """

    def __init__(self, tree, keep, outer=None):
        self.arithmetic, self._keep, self._outer = Arithmetic(tree), keep, outer
        self._known, self._groups = {}, {}

    def behind(self, socket):
        """`Sums` of what arrives at a shader's input socket."""
        link = link_of(socket)
        return Sums() if link is None else self._given(link.from_socket)

    def _given(self, socket):
        """`Sums` of what a shader's output socket gives."""
        key = socket.node.as_pointer(), socket.identifier
        if key not in self._known:
            self._known[key] = self._of(socket)
        return self._known[key]

    def _of(self, socket):
        node = socket.node
        if node.mute:
            passed = [each.from_socket for each in node.internal_links if each.to_socket == socket]
            return self.behind(passed[0]) if passed else Sums()
        if node.type == "REROUTE":
            return self.behind(node.inputs[0])
        if node.type == "MIX_SHADER":
            return self._mixed(node)
        if node.type == "ADD_SHADER":
            return self._added(*(self.behind(each) for each in node.inputs))
        if node.type == "GROUP":
            return self._of_group(socket)
        if node.type == "GROUP_INPUT":
            return self._from_outside(socket)
        closure = CLOSURES.get(node.type)
        return Sums() if closure is None else closure(self.arithmetic, node)

    def _mixed(self, node):
        a, ior = self.arithmetic, self._ior_of(node)
        one, two = (self.behind(each) for each in node.inputs[1:3])
        share = a.saturated(a.of(node.inputs[0]))
        if ior is not None:
            # As plastic was mixed before there was a Principled BSDF.
            less = Sums((name, a.scaled(value, a.left(share))) for name, value in one.items())
            return self._added(less, as_dielectric(a, two, ior))
        mixed = Sums()
        for name in {**one, **two}:
            mixed.add(a, name, a.mixed(share, one.get(name, 0.0), two.get(name, 0.0)))
        return mixed

    def _added(self, *several):
        added = Sums()
        for sums in several:
            for name, value in sums.items():
                added.add(self.arithmetic, name, value)
        return added

    def _ior_of(self, node):
        """The index of refraction by which a mix adds a Glossy BSDF; None where it does not."""
        a = self.arithmetic
        factor, second = (_source(node.inputs[k]) for k in (0, 2))
        if factor is None or second is None or second.node.type != "BSDF_GLOSSY":
            return None
        if factor.node.type == "FRESNEL":
            return a.scalar("MAXIMUM", a.of(factor.node.inputs["IOR"]), 1.0)
        if factor.node.type == "LAYER_WEIGHT" and factor.identifier == "Fresnel":
            rest = a.scalar("MAXIMUM", a.left(a.of(factor.node.inputs["Blend"])), 1e-3)
            return a.scalar("MAXIMUM", a.scalar("DIVIDE", 1.0, rest), 1.0)
        return None

    def _of_group(self, socket):
        node = socket.node
        if node.node_tree is None:
            return Sums()
        inner, result = self._walk_of(node), Sums()
        nodes = inner.arithmetic.tree.nodes
        end = next((n for n in nodes if n.type == "GROUP_OUTPUT" and n.is_active_output), None)
        into = None if end is None else _by_identifier(end.inputs, socket.identifier)
        for name, value in inner.behind(into).items() if into is not None else ():
            if is_socket(value):
                identifier = _new_socket(inner.arithmetic.tree, name, "OUTPUT")
                into = _by_identifier(end.inputs, identifier)
                inner.arithmetic.tree.links.new(value, into)
                value = _by_identifier(node.outputs, identifier)
            result.add(self.arithmetic, name, value)
        return result

    def _walk_of(self, node):
        """The walk of a group's own tree, which becomes a copy."""
        key = node.as_pointer()
        if key not in self._groups:
            copy = node.node_tree.copy()
            self._keep(copy)
            node.node_tree = copy
            self._groups[key] = _Walk(copy, self._keep, (self, node))
        return self._groups[key]

    def _from_outside(self, socket):
        """`Sums` of a shader that is put into a group."""
        outer, node = self._outer if self._outer is not None else (None, None)
        if outer is None:
            return Sums()
        tree, result = self.arithmetic.tree, Sums()
        for name, value in outer.behind(_by_identifier(node.inputs, socket.identifier)).items():
            if is_socket(value):
                identifier = _new_socket(tree, name, "INPUT")
                outer.arithmetic.tree.links.new(value, _by_identifier(node.inputs, identifier))
                value = _by_identifier(socket.node.outputs, identifier)
            result.add(self.arithmetic, name, value)
        return result


def _source(socket):
    """The output that feeds an input, past reroutes; None where nothing does."""
    while (link := link_of(socket)) is not None:
        if link.from_node.type != "REROUTE":
            return link.from_socket
        socket = link.from_node.inputs[0]
    return None


def _new_socket(tree, name, side):
    """The identifier of a new socket of a group."""
    item = tree.interface.new_socket(name, in_out=side, socket_type="NodeSocketVector")
    return item.identifier


def _by_identifier(sockets, identifier):
    return next((socket for socket in sockets if socket.identifier == identifier), None)
