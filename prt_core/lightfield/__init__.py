"""Surface light fields: what leaves a surface in all directions, small enough to be looked at."""

from prt_core.lightfield.ceob import CEOB
from prt_core.lightfield.clustering import cluster_hrdfs_steps, spread_subset
from prt_core.lightfield.compressor import HRDFCompressor
from prt_core.lightfield.field_error import FieldError, field_error
from prt_core.lightfield.goals import GOALS, Goal
from prt_core.lightfield.hrdf import HRDFLayout, to_rgb, to_ycbcr
from prt_core.lightfield.methods import METHODS, compressor_from_text
from prt_core.lightfield.rivals.cosines import Cosines2D
from prt_core.lightfield.rivals.cpca import CPCA
from prt_core.lightfield.rivals.haar import Haar2D
from prt_core.lightfield.rivals.hrdf_harmonics import HRDFHarmonics
from prt_core.lightfield.rivals.ksvd import KSVD
from prt_core.lightfield.surface_light_field import SurfaceLightField
from prt_core.lightfield.tangent_frames import (
    frames_along,
    frames_along_uv,
    smooth_frames,
    uv_tangents,
)
from prt_core.lightfield.viewer import Viewer

__all__ = [
    "CEOB",
    "CPCA",
    "Cosines2D",
    "FieldError",
    "GOALS",
    "Goal",
    "HRDFCompressor",
    "HRDFHarmonics",
    "HRDFLayout",
    "Haar2D",
    "KSVD",
    "METHODS",
    "SurfaceLightField",
    "Viewer",
    "cluster_hrdfs_steps",
    "compressor_from_text",
    "field_error",
    "frames_along",
    "frames_along_uv",
    "smooth_frames",
    "uv_tangents",
    "spread_subset",
    "to_rgb",
    "to_ycbcr",
]
