"""What is kept of an evaluated mesh until Cycles is asked: nothing of Blender's lasts so long."""

import hashlib
from dataclasses import dataclass

import numpy as np

from prt_core.blender.preview_look import is_shaded

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
    """The surface of one evaluated mesh.

    Attributes
    ----------
    name : str
        Of the mesh.
    owner, source : int
        `session_uid` of the object that renders (the instancer), and of that whose mesh it is.
    source_name : str
        As Cycles knows it.
    slots : list of tuple of int
        For each number of a material, the `session_uid` of those that it may be; 0 for none.
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
    slots: list
    slot_of_corner: np.ndarray
    key_of_corner: np.ndarray
    uv: list
    digest: bytes


def record_of(name, owner, source, data, matrix, arrays, random_id=0):
    """The `SurfaceRecord` of an object's evaluated mesh.

    Parameters
    ----------
    name : str
    owner : bpy.types.Object
        The instancer, or the object itself; not evaluated.
    source : bpy.types.Object
        Evaluated.
    data : bpy.types.Mesh
        Evaluated.
    matrix : (4, 4) array
    arrays : tuple of array
        corner_vertex, corner_normal (n_corners, 3) in any space, slot_of_corner, face_sizes.
    random_id : int
        Of an instance.

    Returns
    -------
    SurfaceRecord
    """
    corner_vertex, corner_normal, slot_of_corner, face_sizes = arrays
    key = _mixed(np.zeros(len(corner_vertex), np.uint64), corner_vertex, slot_of_corner)
    key = _mixed(key, *np.rint(np.asarray(corner_normal) / _NORMAL_STEP).astype(np.int64).T)
    digest = hashlib.blake2b(digest_size=16)
    for text in (source.original.name, owner.name, repr(random_id)):
        digest.update(text.encode() + b"\0")
    numbers = [*source.color, source.pass_index, *data.texspace_location, *data.texspace_size]
    digest.update(np.float64(numbers).tobytes() + np.asarray(matrix, np.float64).tobytes())
    for block in (source.original, source.original.data, owner):
        for property_name in sorted(block.keys()) if block is not None else ():
            digest.update(f"{property_name}={_plain(block[property_name])!r}".encode())
    uv = []
    for attribute in data.attributes:
        read = _READ.get(attribute.data_type)
        if read is None or attribute.name.startswith(".") or attribute.name in _GEOMETRY:
            continue
        field, width, dtype = read
        values = np.empty(len(attribute.data) * width, dtype)
        attribute.data.foreach_get(field, values)
        values = values.reshape(-1, width)
        digest.update(attribute.name.encode() + np.ascontiguousarray(values).tobytes())
        if attribute.domain == "FACE":
            values = np.repeat(values, face_sizes, axis=0)
        if attribute.domain in {"FACE", "CORNER"} and len(values) == len(key):
            key = _mixed(key, *(np.asarray(c, np.float32).view(np.uint32) for c in values.T))
            if attribute.data_type == "FLOAT2" and attribute.domain == "CORNER":
                uv.append(values)
    for layer, active in ((data.uv_layers, "active_render"), (data.color_attributes, None)):
        for item in layer:
            if active is None or getattr(item, active):
                digest.update(item.name.encode())
        if active is None:
            digest.update(repr(layer.render_color_index).encode())
    return SurfaceRecord(
        name,
        owner.session_uid,
        source.original.session_uid,
        source.original.name,
        _slots(source, data, int(slot_of_corner.max(initial=0)) + 1),
        np.asarray(slot_of_corner, np.int64),
        key,
        uv,
        digest.digest(),
    )


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


def _slots(source, data, count):
    """For each number: the materials that Cycles may take for it, of the mesh and of the object."""
    original = source.original
    # The preview's material lies over the object's own, which are asked for.
    blocks = [original.data.materials if is_shaded(original) else data.materials]
    candidates = []
    for number in range(count):
        found = []
        for block in blocks:
            if len(block):
                found.append(block[min(number, len(block) - 1)])
        for item in (source, original):
            if len(item.material_slots):
                slot = item.material_slots[min(number, len(item.material_slots) - 1)]
                found.append(slot.material)
        uids = {material.original.session_uid if material else 0 for material in found}
        candidates.append(tuple(sorted(uids)) or (0,))
    return candidates
