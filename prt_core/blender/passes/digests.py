"""Digests of materials: of all that their nodes hold, groups and images included."""

import hashlib
from pathlib import Path

import bpy
import numpy as np

from prt_core.blender.compat import has_nodes

# Of nodes and sockets: where they stand and how they are drawn.
_LOOKS = {
    "rna_type", "location", "location_absolute", "width", "height", "select", "color", "label",
    "use_custom_color", "parent", "dimensions", "hide", "inputs", "outputs", "internal_links",
    "warning_propagation", "show_options", "show_preview", "show_texture", "show_expanded",
    "node_tree", "interface", "bl_idname", "bl_label", "bl_description", "bl_icon", "links", "node",
}  # fmt: skip


class MaterialDigests:
    """Digests of materials, each worked out once.

    Parameters
    ----------
    frame : int
        On which images that move are looked at.
    """

    def __init__(self, frame):
        self._frame, self._known = frame, {}

    def of(self, material):
        """bytes that tell a material (None: none) from any that looks otherwise."""
        return self._once(material, self._material) if material is not None else b"none"

    def _once(self, block, function):
        key = block.as_pointer()
        if key not in self._known:
            self._known[key] = b"in itself"  # a tree that holds itself
            self._known[key] = function(block)
        return self._known[key]

    def _material(self, material):
        digest = hashlib.blake2b(digest_size=16)
        plain = [material.name, list(material.diffuse_color), material.pass_index]
        plain += [getattr(material, "displacement_method", ""), has_nodes(material)]
        digest.update(repr(plain).encode())
        if material.node_tree is not None:
            digest.update(self._once(material.node_tree, self._tree))
        return digest.digest()

    def _tree(self, tree):
        digest = hashlib.blake2b(digest_size=16)
        for node in tree.nodes:
            self._struct(digest, node, 0)
            inner = getattr(node, "node_tree", None)
            if isinstance(inner, bpy.types.NodeTree):
                digest.update(self._once(inner, self._tree))
            for socket in [*node.inputs, *node.outputs]:
                if hasattr(socket, "default_value"):
                    self._value(digest, socket.default_value, 0)
        for link in tree.links:
            ends = (link.from_node.name, link.from_socket.identifier,
                    link.to_node.name, link.to_socket.identifier, link.is_muted)  # fmt: skip
            digest.update(repr(ends).encode())
        return digest.digest()

    def _struct(self, digest, item, depth):
        for attribute in item.bl_rna.properties:
            if attribute.identifier not in _LOOKS:
                digest.update(attribute.identifier.encode())
                self._value(digest, getattr(item, attribute.identifier, None), depth + 1)

    def _value(self, digest, value, depth):
        if isinstance(value, bpy.types.Image):
            digest.update(self._once(value, self._image))
        elif isinstance(value, bpy.types.Object):
            matrix = np.array(value.matrix_world, np.float64)
            digest.update(value.name.encode() + matrix.tobytes())
        elif isinstance(value, bpy.types.ID):
            digest.update(value.name.encode())
        elif isinstance(value, bpy.types.bpy_prop_collection):
            for item in value:
                self._value(digest, item, depth)
        elif isinstance(value, bpy.types.bpy_struct):
            if depth < 4:
                self._struct(digest, value, depth)
        elif hasattr(value, "__len__") and not isinstance(value, str | bytes | set):
            digest.update(
                repr([float(x) if isinstance(x, float) else str(x) for x in value]).encode()
            )
        else:
            digest.update(repr(value).encode())

    def _image(self, image):
        digest = hashlib.blake2b(digest_size=16)
        plain = [image.name, image.source, image.filepath, image.colorspace_settings.name]
        plain += [image.alpha_mode, tuple(image.size), image.generated_type]
        plain += [tuple(image.generated_color), [tile.number for tile in image.tiles]]
        digest.update(repr(plain).encode())
        if image.source in {"MOVIE", "SEQUENCE"}:
            digest.update(repr(self._frame).encode())
        if image.is_dirty:
            pixels = np.empty(len(image.pixels), np.float32)
            image.pixels.foreach_get(pixels)
            digest.update(pixels.tobytes())
        elif image.packed_files:
            for packed in image.packed_files:
                digest.update(packed.packed_file.data if packed.packed_file else b"")
        else:
            path = bpy.path.abspath(image.filepath, library=image.library)
            numbers = [str(tile.number) for tile in image.tiles] or [""]
            for number in numbers:
                file = Path(path.replace("<UDIM>", number))
                digest.update(repr(file.stat().st_mtime_ns if file.is_file() else 0).encode())
        return digest.digest()
