"""Copies of a user's materials that relit light shines on instead of EEVEE's.

What reflects evenly to all sides becomes emission: its colour times the light that a colour
attribute holds. Textures, gloss, metal and glass stay, and EEVEE adds their reflections. The
materials themselves are not touched: an object shows the copies by the preview's modifier.
"""

import bpy

from prt_core.blender.realised import PREVIEW

# Custom property of a copy: the material that it is a copy of.
_OF = "prt_copy_of"
# Nodes whose light leaves evenly to all sides, as far as the eye sees.
_DIFFUSE = {"ShaderNodeBsdfDiffuse", "ShaderNodeSubsurfaceScattering", "ShaderNodeBsdfToon"}


def relit_material(material, attribute):
    """The copy of a material that shows the light of a colour attribute; made where missing.

    Parameters
    ----------
    material : bpy.types.Material or None
        None: Blender's own grey.
    attribute : str
        A colour attribute: irradiance / pi, linear.

    Returns
    -------
    bpy.types.Material
    """
    for copy in bpy.data.materials:
        made_here = copy.library is None and copy.get(PREVIEW) == attribute and _OF in copy.keys()
        if made_here and _original_of(copy) == material:
            return copy
    copy = bpy.data.materials.new("Default") if material is None else material.copy()
    copy.name = f"{copy.name if material is None else material.name} relit"
    copy[PREVIEW], copy[_OF] = attribute, False if material is None else material
    copy.use_fake_user = False
    _relight(_tree_of(copy), attribute, {})
    return copy


def forget_copies(attribute):
    """Remove the copies of an attribute: their originals have changed; they are made again."""
    copies = [m for m in bpy.data.materials if m.get(PREVIEW) == attribute and _OF in m.keys()]
    bpy.data.batch_remove(copies)


def _original_of(copy):
    return copy[_OF] or None


def _tree_of(material):
    """The node tree of a material of our own, also where its original has none or hides it."""
    if material.node_tree is not None and material.use_nodes:
        return material.node_tree
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = material.diffuse_color
    shader.inputs["Metallic"].default_value = material.metallic
    shader.inputs["Roughness"].default_value = material.roughness
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return tree


def _relight(tree, attribute, groups):
    """Change a tree of our own, and the node groups in it, which are copied once each."""
    edit = _Edit(tree, attribute)
    for node in list(tree.nodes):
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            original = node.node_tree
            if original not in groups:
                groups[original] = original.copy()
                groups[original][PREVIEW] = attribute
                groups[original].use_fake_user = False
                _relight(groups[original], attribute, groups)
            node.node_tree = groups[original]
        elif node.bl_idname == "ShaderNodeBsdfPrincipled":
            edit.principled(node)
        elif node.bl_idname == "ShaderNodeEeveeSpecular":
            edit.specular(node)
        elif node.bl_idname in _DIFFUSE:
            edit.diffuse(node)


class _Edit:
    """Arithmetic with sockets in one tree; numbers stay numbers where nothing is linked."""

    def __init__(self, tree, attribute):
        self.tree, self.attribute, self._light = tree, attribute, None

    def principled(self, node):
        """Dielectrics: diffuse into emission. Metal and glass keep their colour for EEVEE."""
        base, metallic = self.read(node.inputs["Base Color"]), self.read(node.inputs["Metallic"])
        through = self.read(node.inputs["Transmission Weight"])
        opaque = self.complement(through)
        even = self.product(self.complement(metallic), opaque)
        shown = self.scaled(self.times(base, self.light), even)
        own, strength = (
            self.read(node.inputs[name]) for name in ("Emission Color", "Emission Strength")
        )
        emitted = shown if strength == 0 else self.plus(shown, self.scaled(own, strength))
        self.set(node.inputs["Emission Color"], emitted)
        self.set(node.inputs["Emission Strength"], 1.0)
        self.set(node.inputs["Base Color"], self.scaled(base, self.complement(even)))

    def specular(self, node):
        shown = self.times(self.read(node.inputs["Base Color"]), self.light)
        own = self.read(node.inputs["Emissive Color"])
        self.set(node.inputs["Emissive Color"], self.plus(shown, own))
        self.set(node.inputs["Base Color"], (0.0, 0.0, 0.0, 1.0))

    def diffuse(self, node):
        emission = self.tree.nodes.new("ShaderNodeEmission")
        shown = self.times(self.read(node.inputs["Color"]), self.light)
        self.set(emission.inputs["Color"], shown)
        for link in list(node.outputs[0].links):
            self.tree.links.new(emission.outputs[0], link.to_socket)
        self.tree.nodes.remove(node)

    @property
    def light(self):
        if self._light is None:
            self._light = self.tree.nodes.new("ShaderNodeVertexColor")
            self._light.layer_name = self.attribute
        return self._light.outputs["Color"]

    @staticmethod
    def read(socket):
        """What comes into a socket: an output, or its own value."""
        if socket.is_linked:
            return socket.links[0].from_socket
        value = socket.default_value
        return value if isinstance(value, float) else tuple(value)

    def set(self, socket, value):
        for link in list(socket.links):
            self.tree.links.remove(link)
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif isinstance(value, float):
            socket.default_value = value
        else:
            # A vector where the socket wants it without alpha.
            socket.default_value = tuple(value)[: len(socket.default_value)]

    def complement(self, value):
        return 1 - value if isinstance(value, float) else self._math("SUBTRACT", 1.0, value)

    def product(self, one, two):
        if isinstance(one, float) and isinstance(two, float):
            return one * two
        return self._math("MULTIPLY", one, two)

    def times(self, one, two):
        return self._vector("MULTIPLY", one, two)

    def plus(self, one, two):
        return self._vector("ADD", one, two)

    def scaled(self, colour, factor):
        if factor == 1:
            return colour
        node = self.tree.nodes.new("ShaderNodeVectorMath")
        node.operation = "SCALE"
        self.set(node.inputs[0], colour)
        self.set(node.inputs["Scale"], factor)
        return node.outputs[0]

    def _math(self, operation, *values):
        return self._node("ShaderNodeMath", operation, values)

    def _vector(self, operation, *values):
        return self._node("ShaderNodeVectorMath", operation, values)

    def _node(self, kind, operation, values):
        node = self.tree.nodes.new(kind)
        node.operation = operation
        for socket, value in zip(node.inputs, values, strict=False):
            self.set(socket, value)
        return node.outputs[0]
