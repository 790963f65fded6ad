"""Which surfaces of a scene emit light, and which of them are one light together.

An emitter is a material: all surfaces of one material are one light, on however many objects, for
so a person knows it, and so its colour and strength are set. A material emits where any of its bake
points does, by its own place, by the area that it stands for, or by its back.
"""

import numpy as np

from prt_core.scene.lattice import lattice_size


def find_emitters(meshes, stack, levels, built, surfaces):
    """The emitters of meshes and what belongs to each.

    Parameters
    ----------
    meshes : sequence of Mesh
    stack : Stack
    levels : (n_triangles,) int
    built : SimpleNamespace
        See `make_points`.
    surfaces : Surfaces

    Returns
    -------
    names : tuple of str
    triangle_emitter : (n_triangles,) int32
        -1 where a triangle belongs to none.
    point_emitter : (n_points,) int32
    """
    points = built.points
    none = np.int32(-1)
    own, mean = points.materials.emission, points.mean_materials.emission
    shining = ((own > 0) | (mean > 0)).any(axis=1)
    if surfaces.back is not surfaces.bounced:
        lattice = levels, built.lattice_start, built.lattice
        behind = surfaces.back.of_points(*lattice, np.arange(len(points)))
        shining |= surfaces.back.mean(*lattice, behind).emission.any(axis=1)
    if not shining.any():
        return (), np.broadcast_to(none, len(levels)), np.broadcast_to(none, len(points))
    first = stack.first_triangle
    materials = [
        mesh.corner_material[stack.corners[begin:end, 0]]
        for mesh, begin, end in zip(meshes, first, first[1:], strict=False)
    ]
    keys = np.column_stack([stack.triangle_object, np.concatenate(materials)])
    groups, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.reshape(-1)
    # The corners of a lattice are of one material: no point is shared by two.
    of_lattice = np.repeat(group, lattice_size(levels))
    point_group = np.full(len(points), -1)
    point_group[built.lattice] = of_lattice
    shines = np.zeros(len(groups) + 1, bool)
    shines[point_group[shining]] = True
    names, emitter = {}, np.full(len(groups) + 1, -1, np.int32)
    for index in np.flatnonzero(shines[:-1]):
        owner, material = groups[index].tolist()
        emitter[index] = names.setdefault(meshes[owner].material_name(material), len(names))
    # What diffuse rays do not see shines for the viewer only.
    unseen = np.array([not mesh.diffuse_rays for mesh in meshes], bool)
    seen = ~unseen[stack.triangle_object]
    triangle_emitter = np.where(seen, emitter[group], -1).astype(np.int32)
    return tuple(names), triangle_emitter, emitter[point_group]
