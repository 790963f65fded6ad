"""What a refined mesh takes over from the object that it stands in for: UV maps and attributes."""

import bpy
import numpy as np

# The attribute of vertices that says in which round of refinement each was made.
ROUNDS = "PRT Refined"
# What is between corners of attributes by their type: how many numbers, and the field of an item.
_BETWEEN = {
    "FLOAT": (1, "value"),
    "FLOAT2": (2, "vector"),
    "FLOAT_VECTOR": (3, "vector"),
    "FLOAT_COLOR": (4, "color"),
    "BYTE_COLOR": (4, "color"),
}


def note_rounds(mesh, refined):
    """Write down which vertices are new, as a whole number for each: 0 for those that were there.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    refined : Refined
    """
    attribute = mesh.attributes.new(ROUNDS, "INT", "POINT")
    attribute.data.foreach_set("value", np.ascontiguousarray(refined.vertex_round))


def carry_over(mesh, refined, original):
    """Give a refined mesh the UV maps and attributes of its original, between corners linearly.

    Attributes of edges and faces, and whole numbers, have nothing in between and stay behind, and
    so does everything where the original is another mesh by now.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    refined : Refined
    original : bpy.types.Object or None
    """
    source = _mesh_of(original, refined.n_before)
    if source is None:
        return
    corner_vertex = np.empty((2, max(len(mesh.loops), len(source.loops))), np.int32)
    own, before = corner_vertex[0, : len(mesh.loops)], corner_vertex[1, : len(source.loops)]
    mesh.loops.foreach_get("vertex_index", own)
    source.loops.foreach_get("vertex_index", before)
    maps = {layer.name for layer in source.uv_layers}
    for name in [attribute.name for attribute in source.attributes]:
        attribute = source.attributes[name]
        known = attribute.data_type in _BETWEEN and attribute.domain in ("POINT", "CORNER")
        if not known or name == "position" or name.startswith(".") or name in mesh.attributes:
            continue
        width, field = _BETWEEN[attribute.data_type]
        values = np.empty(len(attribute.data) * width, np.float32)
        attribute.data.foreach_get(field, values)
        values = values.reshape(-1, width)
        at_corners = values[before] if attribute.domain == "POINT" else values
        between = np.einsum("mk,mkc->mc", refined.weights, at_corners[refined.around])
        if attribute.domain == "POINT":
            at_vertices = np.zeros((len(mesh.vertices), width), np.float32)
            at_vertices[own] = between
            between = at_vertices
        if name in maps:
            target = mesh.uv_layers.new(name=name, do_init=False)
            target = mesh.attributes[target.name]
        else:
            target = mesh.attributes.new(name, attribute.data_type, attribute.domain)
        target.data.foreach_set(field, np.ascontiguousarray(between, np.float32).ravel())


def _mesh_of(original, n_corners):
    """The mesh of an object that has so many corners: its own, or with its modifiers."""
    if original is None:
        return None
    if original.type == "MESH" and len(original.data.loops) == n_corners:
        return original.data if original.mode != "EDIT" else None
    evaluated = original.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.data
    return mesh if isinstance(mesh, bpy.types.Mesh) and len(mesh.loops) == n_corners else None
