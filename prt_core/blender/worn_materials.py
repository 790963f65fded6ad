"""Realised copies in the materials of what they were made of: slots, UV map, normals, own space.

Copies are built in world space and show colours alone. To be seen in an object's own materials
they need what these read: the material of each face, the UV map that renders take, the shading
normals as they were baked, and the space of the object, which the coordinates *Object* and
*Generated* are of.
"""

import bpy
import numpy as np

from prt_core.blender.identity import find_object
from prt_core.blender.own_materials import relit_material

# Custom property of a copy: it has had all of this once, and needs but its materials.
_READY = "prt_wears"
# Entries of a matrix that Blender's location, rotation and scale give back so nearly are the same.
_SAME = 1e-4
_UV_MAP = "UVMap"


def wear_own(copy, item, owner, normals, attribute):
    """Give a copy the relit materials of what it was made of.

    Parameters
    ----------
    copy : bpy.types.Object
    item : SceneObject
        Its mesh in the bake.
    owner : bpy.types.Object or None
        What the mesh belongs to.
    normals : (n_corners, 3) float32
        Shading normals of the corners, in world space.
    attribute : str
        The colour attribute of the light.
    """
    if item.parts is None:
        return
    source = _source(owner, item.source)
    if _READY not in copy:
        copy[_READY] = True
        _map_uv(copy.data, item.parts.corner_uv, source)
        _split_faces(copy.data, item)
        _to_own_space(copy, item.parts.matrix, normals)
    names = item.parts.material_names or ("",)
    _fill_slots(copy.data, [relit_material(_material(name, source), attribute) for name in names])


def wear_colours(copy, material):
    """Give a copy back the one material that shows colours."""
    # Faces keep the numbers of their slots only where no slot goes.
    _fill_slots(copy.data, [material] * max(len(copy.data.materials), 1))


def _source(owner, name):
    """The object whose slots a mesh has: that which is instanced, or the owner itself."""
    if owner is None or not name:
        return owner
    group = owner.instance_collection if owner.instance_type == "COLLECTION" else None
    candidates = [] if group is None else [o for o in group.all_objects if o.name == name]
    return candidates[0] if candidates else find_object(name) or owner


def _material(name, source):
    """A material by its name in the bake: of the object's slots first, then of the file."""
    slots = [] if source is None else [slot.material for slot in source.material_slots]
    named = [material for material in slots if material is not None and material.name == name]
    return named[0] if named else bpy.data.materials.get(name) if name else None


def _fill_slots(mesh, materials):
    while len(mesh.materials) < len(materials):
        mesh.materials.append(None)
    for slot, material in enumerate(materials):
        if mesh.materials[slot] != material:
            mesh.materials[slot] = material


def _split_faces(mesh, item):
    """The number of each face's material; beyond the last slot Blender takes the last."""
    first = np.concatenate([[0], np.cumsum(item.face_sizes)[:-1]])
    numbers = np.ascontiguousarray(item.parts.corner_material[first], np.int32)
    mesh.polygons.foreach_set("material_index", numbers)
    mesh.polygons.foreach_set("use_smooth", np.ones(len(mesh.polygons), bool))


def _map_uv(mesh, corner_uv, source):
    """The UV map that renders take, by the name that it has on the object."""
    layers = getattr(getattr(source, "data", None), "uv_layers", ())
    name = next((layer.name for layer in layers if layer.active_render), _UV_MAP)
    if corner_uv is not None and name not in mesh.uv_layers:
        layer = mesh.uv_layers.new(name=name, do_init=False)
        if layer is not None:
            layer.data.foreach_set("uv", np.ascontiguousarray(corner_uv, np.float32).ravel())


def _to_own_space(copy, matrix, normals):
    """Put a copy into its object's space, where that has a place, a rotation and a scale only; and
    give it its normals."""
    mesh, before = copy.data, np.array(copy.matrix_basis)
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    world = places.reshape(-1, 3).astype(np.float64) @ before[:3, :3].T + before[:3, 3]
    linear = before[:3, :3]
    mirrored = np.linalg.det(linear) < 0
    if np.isfinite(matrix).all() and np.linalg.cond(matrix[:3, :3]) < 1 / _SAME:
        copy.matrix_basis = _blender_matrix(matrix)
        as_set = np.array(copy.matrix_basis)
        same = np.allclose(as_set, matrix, rtol=0, atol=_SAME * np.abs(matrix).max())
        if same and (np.linalg.det(as_set[:3, :3]) < 0) == mirrored:
            linear = as_set[:3, :3]
            local = (world - as_set[:3, 3]) @ np.linalg.inv(linear).T
            mesh.vertices.foreach_set("co", local.astype(np.float32).ravel())
        else:
            copy.matrix_basis = _blender_matrix(before)
    turned = np.asarray(normals, np.float64) @ linear
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    mesh.normals_split_custom_set((turned / np.where(length > 0, length, 1)).astype(np.float32))
    mesh.update()


def _blender_matrix(matrix):
    from mathutils import Matrix

    return Matrix(np.asarray(matrix).tolist())
