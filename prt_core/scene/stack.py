"""The meshes of a scene, one after the other in arrays, and the frame that they lie in."""

import numpy as np

from prt_core.reflectance import Materials


def stack_meshes(meshes, messages):
    """All meshes as one set of arrays; triangles without area are dropped and counted.

    Parameters
    ----------
    meshes : sequence of Mesh
    messages : list of str
        Told what was dropped.

    Returns
    -------
    stacked : dict of arrays
        One mesh after the other: vertices, corner_vertex, corner_normal, corner_material,
        corner_object, materials, triangle_corners, triangle_object, triangles; and of each mesh
        receives, flat, two_sided.
    counts : dict of list of int
        Of each mesh first_corner, n_corners.
    """
    first_vertex = first_corner = 0
    parts = {
        key: []
        for key in "vertices corner_vertex corner_normal corner_material materials "
        "corner_object triangle_corners triangle_object".split()
    }
    counts = {"first_corner": [], "n_corners": []}
    for index, mesh in enumerate(meshes):
        corners = mesh.solid_triangles()
        ignored = len(mesh.triangle_corners) - len(corners)
        if ignored:
            messages.append(f"{mesh.name}: {ignored} triangles without area ignored")
        parts["vertices"].append(mesh.vertices)
        parts["corner_vertex"].append(mesh.corner_vertex + first_vertex)
        parts["corner_normal"].append(mesh.corner_normal)
        parts["materials"].append(mesh.materials)
        parts["corner_material"].append(mesh.corner_material)
        parts["corner_object"].append(np.full(len(mesh.corner_vertex), index))
        parts["triangle_corners"].append(corners + first_corner)
        parts["triangle_object"].append(np.full(len(corners), index))
        counts["first_corner"].append(first_corner)
        counts["n_corners"].append(len(mesh.corner_vertex))
        first_vertex += len(mesh.vertices)
        first_corner += len(mesh.corner_vertex)
    shapes = {name: (0, 3) for name in ("vertices", "corner_normal", "triangle_corners")}
    materials = Materials.joined(parts.pop("materials"))
    stacked = {
        key: np.concatenate(values) if values else np.zeros(shapes.get(key, 0))
        for key, values in parts.items()
    }
    stacked["materials"] = materials
    stacked["receives"] = np.array([mesh.receives for mesh in meshes], bool)
    stacked["flat"] = np.array([mesh.flat for mesh in meshes], bool)
    stacked["two_sided"] = np.array([mesh.two_sided for mesh in meshes], bool)
    stacked["triangles"] = stacked["corner_vertex"][stacked["triangle_corners"].astype(np.int64)]
    return stacked, counts


def frame_of(positions):
    """Centre and size (longest side of the bounding box) of what is seen, float64."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    return (low + high) / 2, float((high - low).max())
