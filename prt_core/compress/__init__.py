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
    ClusterEvaluator,
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
from prt_core.runtime.renamed import renamed_names

__all__ = [
    "PCA",
    "ArrayRows",
    "BlockPCA",
    "ClusterEvaluator",
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

__getattr__ = renamed_names(
    __name__,
    {
        "method_asked": (f"{__name__}.method_from_text", method_from_text),
        "ClusterRelighter": (f"{__name__}.ClusterEvaluator", ClusterEvaluator),
    },
)
