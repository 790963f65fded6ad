"""Images whose pixels are bake points: of a camera, or of a surface laid out flat."""

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

__all__ = [
    "Layout",
    "PARAMETRISATIONS",
    "PointImage",
    "geometry_layout",
    "hits_in_view",
    "surface_points",
    "with_camera_image",
    "with_geometry_image",
]
