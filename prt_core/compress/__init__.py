"""Transport in fewer bytes, and relighting from them."""

from prt_core.compress import standard  # noqa: F401  (makes the methods known)
from prt_core.compress.base import Compressor
from prt_core.compress.choose import Limits, Trial, choose_steps
from prt_core.compress.clustered_pca import ClusteredPCA
from prt_core.compress.haar_lighting import HaarLighting, IncrementalLighting
from prt_core.compress.harmonics import Harmonics, Irradiance
from prt_core.compress.image_rows import ImageRows
from prt_core.compress.methods import (
    Method,
    Task,
    method_named,
    method_names,
    register_method,
)
from prt_core.compress.pca import PCA, BlockPCA
from prt_core.compress.realtime import ClusterRelighter
from prt_core.compress.row_code import RowCode
from prt_core.compress.rows import ArrayRows, Rows, SomeRows, TransportRows
from prt_core.compress.seams import border_pairs, neighbour_pairs, seam
from prt_core.compress.sparse_clusters import SparseClusteredPCA
from prt_core.compress.vq import VectorQuantisation
from prt_core.compress.wavelet4d import Wavelet4D

__all__ = [
    "PCA",
    "ArrayRows",
    "BlockPCA",
    "ClusterRelighter",
    "ClusteredPCA",
    "Compressor",
    "HaarLighting",
    "Harmonics",
    "ImageRows",
    "IncrementalLighting",
    "Irradiance",
    "Limits",
    "Method",
    "RowCode",
    "Rows",
    "SomeRows",
    "SparseClusteredPCA",
    "Task",
    "TransportRows",
    "Trial",
    "VectorQuantisation",
    "Wavelet4D",
    "border_pairs",
    "choose_steps",
    "method_named",
    "method_names",
    "neighbour_pairs",
    "register_method",
    "seam",
]
