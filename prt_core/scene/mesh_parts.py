"""`MeshParts`: what a bake keeps of a mesh for other programs only, for no light depends on it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class MeshParts:
    """What of a mesh is carried out of a bake, and not needed to relight it.

    Attributes
    ----------
    triangle_corners : (n_triangles, 3) int32
        Corners of the object's triangles that have an area, in the order of the scene's.
    corner_material : (n_corners,) int32
        Number of the material.
    material_names : tuple of str
        By number; numbers beyond are of the last one, as in Blender.
    matrix : (4, 4) float64
        From the object's own space to the world's.
    corner_uv : (n_corners, 2) float32 or None
        The UV map that renders take.
    """

    triangle_corners: np.ndarray
    corner_material: np.ndarray
    material_names: tuple
    matrix: np.ndarray
    corner_uv: np.ndarray | None = None


def parts_of_meshes(meshes, stack, as_int32):
    """The `MeshParts` of each mesh of a scene.

    Parameters
    ----------
    meshes : sequence of Mesh
    stack : Stack
    as_int32 : callable(values)
        Gives them in int32, the same ones for the same ones: instances share theirs.

    Returns
    -------
    list of MeshParts
    """
    first = stack.first_triangle
    return [
        MeshParts(
            stack.corners[begin:end],
            as_int32(mesh.corner_material),
            mesh.material_names,
            np.eye(4) if mesh.matrix is None else mesh.matrix,
            None if mesh.corner_uv is None else mesh.corner_uv.astype(np.float32),
        )
        for mesh, begin, end in zip(meshes, first, first[1:], strict=False)
    ]
