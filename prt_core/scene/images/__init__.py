"""Images whose pixels are bake points: of a camera, or of a surface laid out flat."""

from prt_core.scene.images.atlas import Atlas, with_atlas
from prt_core.scene.images.geometry_images import (
    PARAMETRISATIONS,
    Layout,
    geometry_layout,
    with_geometry_image,
)
from prt_core.scene.images.point_images import (
    PointImage,
    hits_in_view,
    surface_points,
    with_camera_image,
)
from prt_core.scene.images.seams import Seams

__all__ = [
    "Atlas",
    "Layout",
    "PARAMETRISATIONS",
    "PointImage",
    "geometry_layout",
    "Seams",
    "hits_in_view",
    "surface_points",
    "with_atlas",
    "with_camera_image",
    "with_geometry_image",
]
