"""Points in clusters, each an affine space of few dimensions."""

from prt_core.compress.clusters.clustered_pca import ClusteredPCA
from prt_core.compress.clusters.pca import PCA, BlockPCA
from prt_core.compress.clusters.realtime import ClusterEvaluator
from prt_core.compress.clusters.seams import border_pairs, neighbour_pairs, seam
from prt_core.compress.clusters.sparse_clusters import SparseClusteredPCA
from prt_core.compress.clusters.vq import VectorQuantisation

__all__ = [
    "PCA",
    "BlockPCA",
    "ClusterEvaluator",
    "ClusteredPCA",
    "SparseClusteredPCA",
    "VectorQuantisation",
    "border_pairs",
    "neighbour_pairs",
    "seam",
]
