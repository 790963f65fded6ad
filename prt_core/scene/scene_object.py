"""`SceneObject`: an object of a scene, as a bake knows it."""

from dataclasses import dataclass

import numpy as np

from prt_core.scene.mesh import RAYS
from prt_core.scene.mesh_parts import MeshParts, parts_of_meshes
from prt_core.scene.refined import Refined


@dataclass(frozen=True)
class SceneObject:
    """One object of a scene: its name, its corners and how they map to points.

    Attributes
    ----------
    name : str
    corner_point : (n_corners,) int32
        The point of each corner, -1 where a corner belongs to no triangle of area.
    corner_vertex : (n_corners,) int32
    face_sizes : (n_faces,) int32
    n_vertices : int
    receives, two_sided, own_mesh : bool
    owner, library, source : str
    shadow_rays, diffuse_rays, camera_rays : bool
        As those of the `Mesh` it was made from.
    parts : MeshParts or None
        What other programs want of the mesh; None of bakes from before it was kept.
    refined : Refined or None
        Where its corners were before edges were split; None where none was.
    """

    name: str
    corner_point: np.ndarray
    corner_vertex: np.ndarray
    face_sizes: np.ndarray
    n_vertices: int
    receives: bool
    two_sided: bool
    own_mesh: bool
    owner: str
    library: str = ""
    source: str = ""
    shadow_rays: bool = True
    diffuse_rays: bool = True
    camera_rays: bool = True
    parts: MeshParts | None = None
    refined: Refined | None = None

    @property
    def known_as(self):
        """What lamps call it: the name of its owner, or for an instance "owner/source".

        A linked owner is called "name [library]".
        """
        owner = f"{self.owner} [{self.library}]" if self.library else self.owner
        return f"{owner}/{self.source}" if self.source else owner


def objects_of_meshes(meshes, stack, corner_point):
    """The `SceneObject` of each mesh of a scene.

    Parameters
    ----------
    meshes : sequence of Mesh
    stack : Stack
    corner_point : (n_corners,) int32
        Of the corners of all meshes.

    Returns
    -------
    list of SceneObject
    """
    known = {}

    def as_int32(array):
        # Instances have one array: it is held once.
        if id(array) not in known:
            known[id(array)] = array.astype(np.int32)
        return known[id(array)]

    parts, first = parts_of_meshes(meshes, stack, as_int32), stack.first_corner
    return [
        SceneObject(
            mesh.name,
            corner_point[begin:end],
            as_int32(mesh.corner_vertex),
            mesh.face_sizes,
            len(mesh.vertices),
            mesh.receives,
            mesh.two_sided,
            mesh.own_mesh,
            mesh.owner,
            mesh.library,
            mesh.source,
            *(getattr(mesh, name) for name in RAYS),
            part,
            mesh.refined,
        )
        for mesh, begin, end, part in zip(meshes, first, first[1:], parts, strict=False)
    ]
