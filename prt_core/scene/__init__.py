"""What is baked: triangles, their materials, and the points that receive and bounce light."""

from prt_core.scene.points import BakePoints
from prt_core.scene.scene import Mesh, Scene, SceneObject

__all__ = ["BakePoints", "Mesh", "Scene", "SceneObject"]
