"""What is baked: triangles, their materials, and the points that receive and bounce light."""

from prt_core.scene.backs import with_backs
from prt_core.scene.camera import (
    Camera,
    ViewRays,
    auto_camera,
    camera_rays,
    expect_camera,
    view_rays,
)
from prt_core.scene.changes import Changes, changes, mesh_digests
from prt_core.scene.compared import compare
from prt_core.scene.details import Details, with_details
from prt_core.scene.ended import ended_at, ended_share
from prt_core.scene.images import (
    PARAMETRISATIONS,
    Atlas,
    Layout,
    PointImage,
    Seams,
    geometry_layout,
    hits_in_view,
    surface_points,
    with_atlas,
    with_camera_image,
    with_geometry_image,
)
from prt_core.scene.mesh import RAYS, Mesh
from prt_core.scene.mesh_parts import MeshParts
from prt_core.scene.opacity import Opacity
from prt_core.scene.points import MATERIALS, BakePoints
from prt_core.scene.ray_offset import MOST_OFFSET
from prt_core.scene.refine import LOCAL, SplitMeshes, split_evenly
from prt_core.scene.refined import Refined
from prt_core.scene.scene import Scene
from prt_core.scene.scene_object import SceneObject
from prt_core.scene.view_transform import ViewTransform

__all__ = [
    "Atlas",
    "BakePoints",
    "Camera",
    "Changes",
    "Details",
    "LOCAL",
    "Layout",
    "MATERIALS",
    "MOST_OFFSET",
    "Mesh",
    "MeshParts",
    "Opacity",
    "PARAMETRISATIONS",
    "PointImage",
    "RAYS",
    "Refined",
    "Scene",
    "SceneObject",
    "SplitMeshes",
    "ViewRays",
    "ViewTransform",
    "auto_camera",
    "camera_rays",
    "changes",
    "compare",
    "ended_at",
    "ended_share",
    "expect_camera",
    "geometry_layout",
    "hits_in_view",
    "mesh_digests",
    "split_evenly",
    "surface_points",
    "view_rays",
    "with_backs",
    "Seams",
    "with_atlas",
    "with_camera_image",
    "with_details",
    "with_geometry_image",
]
