"""Transport in fewer bytes, and relighting from them."""

from prt_core.compress.base import Compressor
from prt_core.compress.choice import (
    Limits,
    Method,
    Task,
    Trial,
    candidate_names,
    choose_steps,
    method_from_text,
    method_named,
    method_names,
    register_method,
)
from prt_core.compress.clusters import (
    PCA,
    BlockPCA,
    ClusteredPCA,
    ClusterRelighter,
    SparseClusteredPCA,
    VectorQuantisation,
    border_pairs,
    neighbour_pairs,
    seam,
)
from prt_core.compress.harmonics import Harmonics, Irradiance
from prt_core.compress.rows import ArrayRows, RowCode, Rows, SomeRows, TransportRows
from prt_core.compress.rows.image_rows import ImageRows
from prt_core.compress.wavelets import HaarLighting, IncrementalLighting, Wavelet4D

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
    "candidate_names",
    "choose_steps",
    "method_from_text",
    "method_named",
    "method_names",
    "neighbour_pairs",
    "register_method",
    "seam",
]
