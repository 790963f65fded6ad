"""What the nodes of a lamp may ask of its object, for the one that stands in for it in renders."""

from dataclasses import dataclass

from prt_core.blender.node_trees import all_nodes, numbers_of, with_answers

_MOST = 0xFFFFFFFF
_START = 0xDEADBEEF + 8 + 13
# Before the names of what an instancer has.
_INSTANCER = "prt:"


@dataclass(frozen=True)
class LampObject:
    """What Object Info and Attribute nodes find.

    Attributes
    ----------
    colour : tuple of 4 floats
    number : int
        Of its passes.
    random : float
        Between 0 and 1, by its name or of the instance.
    properties, of_instancer : tuple of (str, object)
        Its own custom ones; what is asked of an instancer, which is the object where it has none.
    is_instance : bool
    """

    colour: tuple
    number: int
    random: float
    properties: tuple
    of_instancer: tuple
    is_instance: bool

    @classmethod
    def of(cls, source, owner, random_id):
        """That of an evaluated object.

        Parameters
        ----------
        source, owner : bpy.types.Object
            The lamp; its instancer, or itself.
        random_id : int or None
            Of the instance; None where it is none.
        """
        own, more = numbers_of(source.data, source), numbers_of(source.data, source, owner)
        random = _named(source.name) if random_id is None else random_id & _MOST
        return cls(
            tuple(source.color), source.pass_index, random / _MOST, tuple(own.items()),
            tuple(more.items()), random_id is not None,
        )  # fmt: skip

    def dress(self, item):
        """Give an object all that is a setting."""
        item.color, item.pass_index = self.colour, self.number
        for name, value in self.properties:
            item[name] = value
        for name, value in self.of_instancer:
            item[_INSTANCER + name] = value

    def answer(self, tree, keep):
        """Change a copy of the lamp's nodes to what the object that is dressed can answer.

        Parameters
        ----------
        tree : bpy.types.NodeTree
        keep : callable(block) -> block
            As `with_answers`.

        Returns
        -------
        list of str
            What it cannot.
        """
        with_answers(tree, keep, {"ShaderNodeObjectInfo": {"Random": self.random}})
        lost, known = [], dict(self.of_instancer)
        for node in [n for n in all_nodes(tree) if n.bl_idname == "ShaderNodeAttribute"]:
            name = node.attribute_name
            if node.attribute_type == "INSTANCER":
                node.attribute_type, node.attribute_name = "OBJECT", _INSTANCER + name
                if self.is_instance and name not in known:
                    lost.append(f"that its nodes read '{name}' of its instances")
        return lost


def _named(name):
    """Cycles' number of what has this name: Jenkins' hash of a sum of its signed characters."""
    total = 0
    for byte in name.encode():
        total = (total * 37 + byte - (byte >> 7 << 8)) & _MOST
    a, b, c = (_START + total) & _MOST, _START, _START
    for bits in (14, 11, 25, 16, 4, 14, 24):
        turned = (b << bits | b >> 32 - bits) & _MOST
        a, b, c = b, ((c ^ b) - turned) & _MOST, a
    return b
