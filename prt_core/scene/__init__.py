"""What is baked: triangles, their materials, and the points that receive and bounce light."""

from prt_core.scene.changes import Changes, changes, mesh_digests
from prt_core.scene.point_images import (
    PointImage,
    atlas_triangles,
    camera_rays,
    with_atlas_image,
    with_camera_image,
)
from prt_core.scene.points import BakePoints
from prt_core.scene.scene import Mesh, Scene, SceneObject

__all__ = [
    "BakePoints",
    "Changes",
    "Mesh",
    "PointImage",
    "Scene",
    "SceneObject",
    "atlas_triangles",
    "camera_rays",
    "changes",
    "mesh_digests",
    "with_atlas_image",
    "with_camera_image",
]
