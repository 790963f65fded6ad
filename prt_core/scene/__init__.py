"""What is baked: triangles, their materials, and the points that receive and bounce light."""

from prt_core.scene.points import BakePoints
from prt_core.scene.scene import Changes, Mesh, Scene, SceneObject, changes, mesh_digests

__all__ = ["BakePoints", "Changes", "Mesh", "Scene", "SceneObject", "changes", "mesh_digests"]
