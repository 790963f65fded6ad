"""What is kept of an evaluated mesh until Cycles is asked: nothing of Blender's lasts so long."""

import hashlib
from dataclasses import dataclass

import numpy as np

from prt_core.blender.colours import ACTIVE_BEFORE, PREVIEW_COLOURS, names_of_preview
from prt_core.blender.node_trees import all_nodes

# How attributes of these types are read, and how many numbers one value is.
_READ = {
    "FLOAT": ("value", 1, np.float32), "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int32), "BOOLEAN": ("value", 1, bool),
    "FLOAT2": ("vector", 2, np.float32), "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32), "BYTE_COLOR": ("color", 4, np.float32),
    "QUATERNION": ("value", 4, np.float32), "INT32_2D": ("value", 2, np.int32),
}  # fmt: skip
_GEOMETRY = {"position", "material_index", "sharp_face", "sharp_edge", "id"}
_NORMAL_STEP = 1e-3


@dataclass
class SurfaceRecord:
    """The surface of one mesh in the world.

    Attributes
    ----------
    name : str
        Of the mesh.
    owner, source : int
        `session_uid` of the object that renders (the instancer), and of that whose mesh it is.
    source_name : str
        As Cycles knows it.
    matrix : (4, 4) float64
        From the mesh's space to the world's.
    slots : tuple of int
        For each number of a material its `session_uid`; 0 for none.
    slot_of_corner : (n_corners,) int
    key_of_corner : (n_corners,) uint64
        Corners with one key look alike to any material.
    uv : list of (n_corners, 2) float32
        All UV maps.
    digest : bytes
        Of all that materials may read from the object.
    """

    name: str
    owner: int
    source: int
    source_name: str
    matrix: np.ndarray
    slots: tuple
    slot_of_corner: np.ndarray
    key_of_corner: np.ndarray
    uv: list
    digest: bytes

    def slot(self, number):
        """`session_uid` of the material of a number; one beyond the last has the last."""
        return self.slots[min(int(number), len(self.slots) - 1)]


@dataclass
class RawSurface:
    """What materials may read from an evaluated mesh; all its instances share it."""

    slots: tuple
    slot_of_corner: np.ndarray
    key_of_corner: np.ndarray
    uv: list
    digest: bytes

    def placed(self, name, owner, source, matrix, random_id):
        """The `SurfaceRecord` of an object or instance.

        Parameters
        ----------
        name : str
        owner : bpy.types.Object
            The instancer, or the object itself; not evaluated.
        source : bpy.types.Object
            Evaluated.
        matrix : (4, 4) array
        random_id : int
            Of an instance.
        """
        digest = hashlib.blake2b(self.digest, digest_size=16)
        original = source.original
        for text in (original.name, owner.name, repr(random_id)):
            digest.update(text.encode() + b"\0")
        numbers = [*source.color, source.pass_index]
        digest.update(np.float64(numbers).tobytes() + np.asarray(matrix, np.float64).tobytes())
        for block in (original, original.data, owner):
            for key in sorted(block.keys()) if block is not None else ():
                # What add-ons register, and our own marks, are nothing to materials.
                if key not in block.bl_rna.properties and not key.startswith("prt_"):
                    digest.update(f"{key}={_plain(block[key])!r}".encode())
        return SurfaceRecord(
            name, owner.session_uid, original.session_uid, original.name,
            np.array(matrix, np.float64), **self._same(), digest=digest.digest(),
        )  # fmt: skip

    def _same(self):
        return {key: value for key, value in vars(self).items() if key != "digest"}


def surface_of(data, original, slots, raw, weights=None):
    """The `RawSurface` of an evaluated mesh.

    Parameters
    ----------
    data : bpy.types.Mesh
    original : bpy.types.ID
        What it was evaluated from.
    slots : sequence of int
        `session_uid` of the material of each number, 0 for none; empty where there are no slots.
    raw : RawMesh
        Its arrays.
    weights : dict of str -> (n_vertices,) float32, optional
        Of vertex groups that materials may read.
    """
    key = np.zeros(len(raw.corner_vertex), np.uint64)
    key = _mixed(key, raw.corner_vertex, raw.corner_slot)
    key = _mixed(key, *np.rint(raw.corner_normal / _NORMAL_STEP).astype(np.int64).T)
    digest, uv = hashlib.blake2b(digest_size=16), []
    # What the preview writes is not the mesh's own.
    before, shown = original.get(ACTIVE_BEFORE), ()
    if before is not None:
        shown = names_of_preview(original.get(PREVIEW_COLOURS, "PRT"))
    digest.update(np.float64([*data.texspace_location, *data.texspace_size]).tobytes())
    for attribute in data.attributes:
        read = _READ.get(attribute.data_type)
        ours = attribute.name in (*shown, *_GEOMETRY)
        if read is None or attribute.name.startswith(".") or ours:
            continue
        field, width, dtype = read
        values = np.empty(len(attribute.data) * width, dtype)
        attribute.data.foreach_get(field, values)
        values = values.reshape(-1, width)
        digest.update(attribute.name.encode() + np.ascontiguousarray(values).tobytes())
        if attribute.domain == "FACE":
            values = np.repeat(values, raw.face_sizes, axis=0)
        if attribute.domain in {"FACE", "CORNER"} and len(values) == len(key):
            key = _mixed(key, *(np.asarray(c, np.float32).view(np.uint32) for c in values.T))
            if attribute.data_type == "FLOAT2" and attribute.domain == "CORNER":
                uv.append(values)
    for name, of_group in (weights or {}).items():
        digest.update(name.encode() + of_group.tobytes())
    rendered = [layer.name for layer in data.uv_layers if layer.active_render]
    colour = data.attributes.default_color_name if before is None else before
    digest.update(repr((rendered, colour)).encode())
    slots = tuple(slots) or (0,)
    return RawSurface(slots, raw.corner_slot, key, uv, digest.digest())


def weights_of(data, groups, materials):
    """The weights of those vertex groups that Attribute nodes read, by name.

    Parameters
    ----------
    data : bpy.types.Mesh
        Evaluated.
    groups : collection of bpy.types.VertexGroup
        Of its object.
    materials : iterable of bpy.types.Material or None

    Returns
    -------
    dict of str -> (n_vertices,) float32
    """
    trees = [m.node_tree for m in materials if m is not None and m.node_tree is not None]
    nodes = [node for tree in trees for node in all_nodes(tree) if node.type == "ATTRIBUTE"]
    names = {node.attribute_name for node in nodes if node.attribute_type == "GEOMETRY"}
    weights = {g.index: np.zeros(len(data.vertices), np.float32) for g in groups if g.name in names}
    if weights:
        for vertex in data.vertices:
            for element in vertex.groups:
                if element.group in weights:
                    weights[element.group][vertex.index] = element.weight
    return {group.name: weights[group.index] for group in groups if group.index in weights}


def _mixed(key, *columns):
    """(n,) uint64 that differ where any of the columns do."""
    with np.errstate(over="ignore"):
        for column in columns:
            key = key ^ (np.asarray(column).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15))
            key = key * np.uint64(0xBF58476D1CE4E5B9)
            key = key ^ (key >> np.uint64(31))
    return key


def _plain(value):
    """A custom property as numbers and texts."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    return value.to_list() if hasattr(value, "to_list") else value
