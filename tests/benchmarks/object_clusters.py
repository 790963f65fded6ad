"""Clustered PCA of 24 components for one object at a time: 70 clusters a model, 120 its ground.

python tests/benchmarks/object_clusters.py [SCENE]     into docs/benchmarks

The numbers of clusters are those of Huang & Ramamoorthi (2010), figure 8, and of a prototype whose
figures stand beside ours.
"""

import json
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from prt_core.blender.measuring import data_folder  # noqa: E402
from prt_core.blender.studio import ALL, studio_paths  # noqa: E402
from prt_core.compress import ClusteredPCA, SomeRows, TransportRows  # noqa: E402
from prt_core.compress.choice.choose import relative_l2  # noqa: E402
from prt_core.light import EnvironmentMap  # noqa: E402
from tests.benchmarks.sections import write_sections  # noqa: E402
from tests.benchmarks.wavelet4d_tables import CACHE, baked  # noqa: E402

PAGE = "compression"
TITLE = "Clusters of one object"
N_CLUSTERS = {"model": 70, "ground": 120}
# Matrix, and relit under the least and the most favourable of THREE: per cent.
PROTOTYPE = {"model": (6.3, "0.7 to 1.4"), "ground": (3.7, "0.14 to 1.3")}
THREE = ("sunset", "courtyard", "city")
# What is compressed: settings of the rows.
WAYS = {
    "direct light, plain": {"rank": 0, "natural": False},
    "direct light, weighed": {"rank": 0},
    "all bounces, weighed": {},
}


def matrix_error(model, rows):
    """Relative L2 of the matrix itself, however its rows were weighed to be compressed."""
    lost = whole = 0.0
    for points in rows.blocks():
        truth = rows.block(points)
        lost += float(((model.reconstruct(points) - truth) ** 2).sum(dtype=np.float64))
        whole += float((truth**2).sum(dtype=np.float64))
    return (lost / whole) ** 0.5


def clusters_table(name="bunny"):
    kept = CACHE / "object_clusters.json"
    known = json.loads(kept.read_text()) if kept.exists() else {}
    bake = baked(name)
    transport, points = bake.transport, bake.scene.points
    names = [item.name for item in bake.scene.objects]
    lights = {light: EnvironmentMap.read(path).to_cube_map(bake.cube_map)
              for light, path in studio_paths(ALL).items()}  # fmt: skip
    lines = [
        f"{name} on its ground, each object alone, 24 components (`object_clusters.py`). Weighed: "
        "rows by how strong their wavelets are in natural light, as `prt compress` does; the "
        "matrix' error is that of the plain matrix. Relit: relative L2 against the exact transport "
        f"under {', '.join(THREE)} (mean and worst of Blender's eight). Prototype: "
        "direct light, the same numbers of clusters.",
        "",
        "| object | points | clusters | rows | MB | matrix | relit | eight "
        "| prototype: matrix, relit |",
        "|---" * 9 + "|",
    ]
    for item, n_clusters in N_CLUSTERS.items():
        mine = np.flatnonzero(points.object_index == names.index(item))
        for way, settings in WAYS.items():
            key = f"{name} {item} {way}"
            if key in known:
                lines.append(known[key])
                continue
            rows = SomeRows(TransportRows(transport, **settings), mine)
            model = ClusteredPCA(n_clusters, 24).fit(rows)
            bounces = 0 if settings.get("rank") == 0 else "baked"
            errors = {
                light: relative_l2(
                    model.product(radiance),
                    transport.product(radiance, bounces=bounces)[mine],
                )
                for light, radiance in lights.items()
            }
            matrix, relit = PROTOTYPE[item]
            lines.append(
                f"| {item} | {len(mine):,} | {n_clusters} | {way} | {model.nbytes / 1e6:.1f} "
                f"| {matrix_error(model, rows):.2%} "
                f"| {', '.join(f'{errors[light]:.2%}' for light in THREE)} "
                f"| {np.mean(list(errors.values())):.2%} ({max(errors.values()):.2%}) "
                f"| {matrix} %, {relit} % |"
            )
            print(lines[-1], flush=True)
            known[key] = lines[-1]
            kept.write_text(json.dumps(known))
    return lines


SECTIONS = {TITLE: lambda: clusters_table() if data_folder() else []}

if __name__ == "__main__":
    write_sections(PAGE, {TITLE: lambda: clusters_table(*sys.argv[1:])})
