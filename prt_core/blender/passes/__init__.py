"""What Cycles says of surfaces, at any places of any meshes, whatever their materials' nodes are.

| file | what |
|---|---|
| `surfaces.py` | `evaluate_surfaces`: the materials of meshes that were read; begin here |
| `evaluation.py` | asks for those that are not known yet |
| `records.py` | what is kept of an evaluated mesh until then |
| `probe.py` | one render of many places: a camera whose rays go through portals |
| `place_reader.py` | places of triangles, looked at until it was these that were seen |
| `cryptomatte.py` | how objects and materials are numbered in it |
| `traces.py` | renders that leave none |
| `openexr.py` | reads what was rendered |
| `quantities.py` | albedo, emission, opacity, translucency of what was rendered, and what to say |
| `gloss.py` | the quantities of gloss, of what closures reflect |
| `gloss_copies.py` | copies of materials that tell what they reflect |
| `gloss_tree.py` | sums over the closures of a tree, mixed as its shaders are |
| `closures.py` | what each closure adds to these sums; what is left out |
| `arithmetic.py` | sums and products by nodes |
| `corners.py` | which corners are sampled |
| `lattices.py` | places between the corners, more where they differ |
| `graphs.py` | what there is to know of a material's nodes without understanding them |
| `closure_normals.py` | whether the shaders of a material have one normal |
| `light_paths.py` | what Light Path nodes answer for a while |
| `digests.py` | whether a material is what it was |
"""

from prt_core.blender.passes.records import SurfaceRecord, surface_of, weights_of
from prt_core.blender.passes.surfaces import evaluate_surfaces

__all__ = ["SurfaceRecord", "evaluate_surfaces", "surface_of", "weights_of"]
