"""The tables and figures of Huang & Ramamoorthi (2010), measured on our scenes.

python tests/benchmarks/huang_tables.py table [SCENES]     entries and errors (figures 9 and 10)
python tests/benchmarks/huang_tables.py radius [SCENE]     error against radius (figure 6)
python tests/benchmarks/huang_tables.py rivals [SCENE]     ways to choose columns (figure 5)
python tests/benchmarks/huang_tables.py quantity [SCENE]   what is reconstructed, and thresholds
python tests/benchmarks/huang_tables.py indirect [BLEND]   indirect light on the quarter grid

Scenes are those of `prt_core.blender.measuring`. `radius`, `rivals` and `quantity` measure some of
the sparse points, the same for all variants, on one set of dense points.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from prt_core.blender.measuring import MODELS, measuring_scene  # noqa: E402
from prt_core.evaluate.bench.sampling import matrix_errors  # noqa: E402
from prt_core.runtime.progress import run  # noqa: E402
from prt_core.sampling.adaptive_angle import AngularGrid  # noqa: E402
from prt_core.sampling.dense import dense_steps  # noqa: E402
from prt_core.sampling.huang import HuangSettings, sample_huang  # noqa: E402
from prt_core.sampling.sparse import SparsePoints, sparse_blocks  # noqa: E402
from prt_core.sampling.tracer import Tracer, count_bits  # noqa: E402
from prt_core.sphere import CubeMap  # noqa: E402
from tests.benchmarks.exhaustive import exhaustive_bits  # noqa: E402

CUBE = CubeMap(32)
# The paper's figures 9 and 10: entries and relative L2 error.
PAPER = {
    ("dancer", "model"): (12.04, 7.43),
    ("dancer", "ground"): (10.85, 1.72),
    ("bunny", "model"): (11.79, 2.86),
    ("bunny", "ground"): (10.54, 0.79),
    ("dragon", "model"): (11.16, None),
}
SOME = 2048
# Of the L1 norm in `radius`.
WEAK = 1e-4


def table(names):
    print("scene    object   points  entries %  (paper)  matrix L2  (paper)  dense err  rank")
    for name in names or MODELS:
        scene, truth, caster = prepared(name)
        result = run(sample_huang(scene, CUBE, caster, HuangSettings()))
        errors, sizes = matrix_errors(scene, CUBE, result.bits, truth)
        is_dense = np.zeros(len(scene.points), bool)
        is_dense[result.dense.points] = True
        for index, item in enumerate(scene.objects):
            mine = scene.points.object_index == index
            entries = 100 * count_bits(result.traced[mine]) / (mine.sum() * CUBE.n_directions)
            share, error = PAPER.get((name, item.name), (None, None))
            of_dense = relative(errors[mine & is_dense], sizes[mine & is_dense])
            print(
                f"{name:8} {item.name:7} {mine.sum():7,d} {entries:10.2f} {told(share)} "
                f"{relative(errors[mine], sizes[mine]):10.2f} {told(error)} {of_dense:10.2f} "
                f"{result.dense.rank[mine].mean():5.2f}",
                flush=True,
            )


def told(value):
    return f"{'':8}" if value is None else f"{value:8.2f}"


def relative(errors, sizes):
    """Per cent."""
    return 100 * float(np.sqrt(errors.sum() / max(sizes.sum(), 1e-300)))


def prepared(name):
    scene = measuring_scene(name)
    truth = exhaustive_bits(name, scene, CUBE)
    return scene, truth, scene.make_caster("embree")


class Sparse:
    """Some sparse points of every object, sampled again and again on the same dense points."""

    def __init__(self, name, settings):
        self.scene, self.truth, self.caster = prepared(name)
        tracer = Tracer(self.scene, CUBE, self.caster)
        self.dense = run(dense_steps(self.scene, tracer, AngularGrid(CUBE), settings))

    def measure(self, settings, index, some=SOME):
        """Of some sparse points of an object.

        Returns
        -------
        dict
            combined, final: matrix L2 in per cent of the combinations, and with the traced
            entries put in; entries, neighbours, used: means of a point.
        """
        tracer = Tracer(self.scene, CUBE, self.caster)
        work = SparsePoints(
            self.scene, CUBE, tracer, self.dense, settings, lambda _, steps: steps, None
        )
        blocks = [
            block
            for block in sparse_blocks(self.scene, self.dense, settings)
            if self.scene.points.object_index[block[0][0]] == index
        ]
        points = np.concatenate([points for points, _ in blocks])
        most = max(neighbours.shape[1] for _, neighbours in blocks)
        neighbours = np.concatenate(
            [
                np.pad(near, ((0, 0), (0, most - near.shape[1])), constant_values=-1)
                for _, near in blocks
            ]
        )
        # Whole groups of points side by side, spread over the object.
        groups = np.random.default_rng(0).permutation(len(points) // 64)[: some // 64]
        rows = (groups[:, None] * 64 + np.arange(64)).ravel()
        points, neighbours = points[rows], neighbours[rows]
        combined, seen, wanted = run(work.sample(points, neighbours))
        scene = _Only(self.scene, points)
        both = combined, (combined & ~wanted) | seen
        errors = [matrix_errors(scene, CUBE, bits, self.truth[points]) for bits in both]
        return {
            "combined": relative(*errors[0]),
            "final": relative(*errors[1]),
            "entries": float(count_bits(wanted, axis=1).mean()),
            "neighbours": float((neighbours >= 0).sum(axis=1).mean()),
            "used": work.attributes()["neighbours_used"],
        }


class _Only:
    """Some points of a scene, as far as `matrix_errors` looks."""

    def __init__(self, scene, points):
        self.points = type("Points", (), {"normals": scene.points.normals[points]})


def radius(names):
    """Figure 6: least squares, L1 and all directions against the radius, position alone.

    Two weights of the L1 norm: one at which the bare combinations are as near as those of least
    squares or nearer at every radius, and the sampler's, at which they are nearest with the traced
    entries put in.
    """
    name = names[0] if names else "dancer"
    base = HuangSettings(normal_weight=0.0, neighbours=160)
    sparse = Sparse(name, base)
    kinds = {
        "least squares": {"reconstruction": "least_squares"},
        f"L1, {WEAK:g} (used)": {"strength": WEAK},
        f"L1, {base.strength:g} (used)": {},
        "full": {"reconstruction": "full"},
    }
    print(f"{name}: matrix L2 % of the combinations (with traced entries put in)")
    print("object  radius  neighbours  " + "  ".join(f"{kind:23}" for kind in kinds).rstrip())
    for index, item in enumerate(sparse.scene.objects):
        for radius in (0.03, 0.06, 0.1, 0.15, 0.2, 0.3):
            cells = []
            for kind, changed in kinds.items():
                # The paper's radius is in units of a ground of 4, ours in the scene's size.
                settings = replace(base, radius=radius / 4, **changed)
                result = sparse.measure(settings, index, SOME // 4)
                used = f", {result['used']:5.1f}" if "L1" in kind else ""
                cells.append(f"{result['combined']:6.2f} ({result['final']:6.2f}{used})")
            print(
                f"{item.name:7} {radius:6.3f} {result['neighbours']:11.1f}  "
                + "  ".join(f"{cell:23}" for cell in cells).rstrip(),
                flush=True,
            )


def rivals(names):
    """Figure 5: columns by variance and features, by Hasan's and by Wang's clusters."""
    name = names[0] if names else "dancer"
    base = HuangSettings()
    sparse = Sparse(name, base)
    print(f"{name}: matrix L2 % of sparse points; entries: rays of each, above its horizon")
    print("object  columns  chosen by  entries  combined   final")
    for index, item in enumerate(sparse.scene.objects):
        for count in (100, 350, 700):
            for choice in ("features", "hasan", "wang"):
                settings = replace(base, features=count, columns=choice)
                result = sparse.measure(settings, index)
                print(
                    f"{item.name:7} {count:7} {choice:>10} {result['entries']:8.1f} "
                    f"{result['combined']:9.2f} {result['final']:7.2f}",
                    flush=True,
                )


def quantity(names):
    """What is combined, thresholds, lambda, normals in the choice of neighbours, ranks."""
    name = names[0] if names else "dancer"
    base = HuangSettings()
    sparse = Sparse(name, base)
    variants = [{"quantity": q, "threshold": t}
                for q in ("transport", "visibility") for t in (0.3, 0.4, 0.5, 0.6)]  # fmt: skip
    variants += [{"strength": s} for s in (1e-1, 3e-2, 1e-2, 1e-3)]
    variants += [{"normal_weight": w} for w in (0.0, 0.01, 0.02, 0.04)]
    variants += [{"neighbours": k} for k in (6, 8, 12, 16, 24, 40)]
    variants += [{"reconstruction": "least_squares"}]
    print(f"{name}: matrix L2 % of sparse points, final (combined)")
    for settings in variants:
        result = [sparse.measure(replace(base, **settings), index) for index in (0, 1)]
        cells = "   ".join(f"{f['final']:6.2f} ({f['combined']:6.2f})" for f in result)
        print(f"{settings!s:50} {cells}", flush=True)


def spread_grid(values, grid):
    """Rows known on the quarter grid alone, spread to all directions: for indirect light.

    Light that has bounced off diffuse surfaces is smooth in the direction it came from, so its
    transport is sampled on the grid only (section 4.2, end). Every other direction takes the mean
    of the grid directions around it, in transport per solid angle, for texels differ in size.

    Parameters
    ----------
    values : (n, n_grid, ...) float
        Transport at `grid.grid`.
    grid : AngularGrid

    Returns
    -------
    (n, n_directions, ...) float, of the dtype of `values`
    """
    solid_angles = grid.cube_map.solid_angles.astype(values.dtype)
    around = AngularGrid(grid.cube_map, 3).neighbours
    trailing = (None,) * (values.ndim - 2)
    density = values / solid_angles[grid.grid][(None, slice(None), *trailing)]
    spread = np.zeros((len(values), len(around), *values.shape[2:]), values.dtype)
    count = np.zeros(len(around), values.dtype)
    for place in range(around.shape[1]):
        # A repeated first entry is padding.
        fresh = (around[:, place] != around[:, 0]) | (place == 0)
        spread[:, fresh] += density[:, around[fresh, place]]
        count[fresh] += 1
    spread *= (solid_angles / count)[(None, slice(None), *trailing)]
    spread[:, grid.grid] = values
    return spread


def indirect(names):
    """The indirect part of T from the quarter grid alone, against every direction."""
    import bpy

    from prt_core.blender.depsgraph import read_scene
    from prt_core.transport import Transport, gather_hits, gather_operator, visibility_bits

    path = names[0] if names else ROOT / "blend_scenes" / "02_model_on_ground_small.blend"
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = read_scene()
    cube_map = CubeMap(16)
    caster = scene.make_caster("embree")
    everything = slice(0, len(scene.points))
    bits = visibility_bits(scene, cube_map, caster, everything)
    hits = gather_hits(scene, caster, everything, 0, 0).hits
    gather = gather_operator(hits, len(scene.points))
    points = scene.points
    transport = Transport(cube_map, bits, gather, points.normals, points.albedo)
    grid = AngularGrid(cube_map)
    chosen = np.random.default_rng(0).choice(len(points), 256, replace=False)
    bounced = transport.rows(chosen) - transport.rows(chosen, indirect=False)
    spread = spread_grid(bounced[:, grid.grid], grid)
    error = np.linalg.norm(spread - bounced) / np.linalg.norm(bounced)
    whole = np.linalg.norm(spread - bounced) / np.linalg.norm(transport.rows(chosen))
    print(f"indirect part from a quarter of its directions: {error:.2%}, of all of T {whole:.2%}")


if __name__ == "__main__":
    kinds = {f.__name__: f for f in (table, radius, rivals, quantity, indirect)}
    if len(sys.argv) < 2 or sys.argv[1] not in kinds:
        sys.exit(__doc__)
    kinds[sys.argv[1]](sys.argv[2:])
