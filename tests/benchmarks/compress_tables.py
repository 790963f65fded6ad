"""What compression is worth beyond `prt bench compress`: its tables, as Markdown.

    python tests/benchmarks/compress_tables.py haar BAKE.prt      # lights cut to few wavelets
    python tests/benchmarks/compress_tables.py sparse NAME [N ...]  # clusters of a sparse bake
    python tests/benchmarks/compress_tables.py scenes FOLDER [NAME ...]  # on other scenes
    python tests/benchmarks/compress_tables.py bounces BAKE.prt   # compressed, or by K
    python tests/benchmarks/compress_tables.py frames SCENE.blend BAKE.prt    # colours in Blender
    python tests/benchmarks/compress_tables.py memory SCENE.blend BAKE.prt   # baked at 64 x 64

NAME is one of `MODELS`, or begins the name of a scene of blend_scenes; FOLDER is
where bakes and rows are kept; the bake of `frames` is compressed and of that scene.
"""

import json
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

import prt_core  # noqa: E402
from prt_core import run  # noqa: E402
from prt_core.blender.measuring import MODELS, data_folder, measuring_scene  # noqa: E402
from prt_core.compress import (  # noqa: E402
    ClusteredPCA,
    HaarLighting,
    SparseClusteredPCA,
    TransportRows,
)
from prt_core.compress.choice.choose import relative_l2  # noqa: E402
from prt_core.compress.clusters.kmeans import kmeans_steps  # noqa: E402
from prt_core.compress.clusters.lbg import lbg_steps  # noqa: E402
from prt_core.compress.clusters.sketch import sketch_steps  # noqa: E402
from prt_core.compress.wavelets.haar_lighting import SELECTIONS  # noqa: E402
from prt_core.light import EnvironmentMap  # noqa: E402
from prt_core.sphere import CubeMap  # noqa: E402
from tests.benchmarks.exhaustive import exhaustive_bits  # noqa: E402

SHARES = (0.001, 0.0025, 0.005, 0.01, 0.02, 0.05, 0.1)
TURNS = (0.0, 120.0, 240.0)
CLUSTERS = (50, 120)
PAGE = "compression"
SCENES, BUDGETS = ("bunny", "dragon", "05_street_bench"), (1, 2, 3)


def images():
    from prt_core.blender_access import import_bpy

    import_bpy()
    from prt_core.blender.studio import ALL, studio_paths

    return {name: EnvironmentMap.read(path) for name, path in studio_paths(ALL).items()}


def haar_rows(path):
    """Error of relit colours against all wavelets, for each selection and number of terms."""
    bake = prt_core.load(path)
    model = HaarLighting(None, step=1e-3).fit(TransportRows(bake.transport))
    n, rows = bake.transport.n_directions, []
    for name, image in images().items():
        for turn in TURNS:
            light = image.to_cube_map(bake.cube_map, turn)
            coefficients = model.transform_light(light)
            every = model.products(model.choose(coefficients, None), coefficients)
            for selection in SELECTIONS:
                for share in SHARES:
                    chosen = model.choose(coefficients, round(share * n), selection)
                    error = relative_l2(model.products(chosen, coefficients), every)
                    rows.append((name, selection, share, error))
    return rows, n


def haar_table(path):
    rows, n = haar_rows(path)
    lines = [
        f"Light cut to its best few of {n:,} wavelets: relative L2 of relit colours against all "
        f"of them, mean (worst) over {len(set(r[0] for r in rows))} HDRIs at {len(TURNS)} "
        "rotations.",
        "",
        "| selection | " + " | ".join(f"{s:.2%} ({s * n:.0f})" for s in SHARES) + " |",
        "|---" * (1 + len(SHARES)) + "|",
    ]
    for selection in SELECTIONS:
        cells = []
        for share in SHARES:
            result = [r[3] for r in rows if r[1:3] == (selection, share)]
            cells.append(f"{np.mean(result):.2%} ({max(result):.1%})")
        lines.append(f"| {selection} | " + " | ".join(cells) + " |")
    return lines


def sparse_task(name):
    """Transport of a measuring scene, with bounces, and the dense points of a sparse bake."""
    from scipy.spatial import cKDTree

    from prt_core.sampling import sampler_named
    from prt_core.transport import Transport, gather_hits, gather_operator

    scene, cube_map = measuring_scene(name), CubeMap(32)
    bits = exhaustive_bits(name, scene, cube_map)
    caster = scene.make_caster("embree")
    every = slice(0, len(scene.points))
    hits = [gather_hits(scene, caster, every, 0, r).hits for r in range(2)]
    gather = gather_operator(np.concatenate(hits, axis=1), len(scene.points))
    sampler, settings = sampler_named("huang")
    dense = run(sampler(scene, cube_map, caster, settings())).dense.points
    caster.close()
    points = scene.points
    transport = Transport(cube_map, bits, gather, points.normals, points.albedo)
    near = np.full((len(points), 12), -1)
    for index in range(len(scene.objects)):
        mine = np.flatnonzero(points.object_index == index)
        known = dense[points.object_index[dense] == index]
        _, result = cKDTree(points.positions[known]).query(points.positions[mine], 12)
        near[mine] = known[result]
    return transport, np.sort(dense), near


class PublishedPCA(ClusteredPCA):
    """Iterative clusters as published: every distance in all features, not in a sketch of them."""

    def fit_steps(self, rows):
        features = np.concatenate([rows.features(block) for block in rows.blocks()])
        sketch = yield from sketch_steps(rows, 64, self.seed)
        labels = yield from kmeans_steps(sketch.coordinates, self.n_clusters, self.seed)
        labels = yield from lbg_steps(features, labels, self.n_components)
        return (yield from self._fit_clusters(rows, labels, self.n_components))


def sparse_table(name, *clusters):
    """Clusters from a sparse bake against iterative and static ones on the full matrix."""
    transport, dense, near = sparse_task(name)
    rows = run(TransportRows(transport).prepare_steps())
    lines = [
        f"{name} on the ground, {rows.n_points:,} points, {len(dense):,} of them dense, 24 "
        "components, all bounces; seconds of clustering and components, relative L2 of the "
        "encoded matrix. Published: after Sloan et al. (2003) with distances in all features; "
        "iterative: the same in 256 coordinates that keep them.",
        "",
        "| clusters | published s | error | iterative s | error | static s | error | from sparse s "
        "| error | published / sparse | iterative / sparse | error / published's "
        "| error / iterative's |",
        "|---" * 13 + "|",
    ]
    for index, n_clusters in enumerate([int(text) for text in clusters] or CLUSTERS):
        result = []
        models = [
            ClusteredPCA(n_clusters, 24, method="iterative"),
            ClusteredPCA(n_clusters, 24),
            SparseClusteredPCA(dense, near, n_clusters, 24),
        ]
        # The published way takes a quarter of an hour: for the first number of clusters only.
        for model in models if index else [PublishedPCA(n_clusters, 24), *models]:
            start = time.perf_counter()
            model.fit(rows)
            result.append((time.perf_counter() - start, model.matrix_error_))
            print(n_clusters, type(model).__name__, *result[-1], file=sys.stderr, flush=True)
        published = result.pop(0) if len(result) > 3 else None
        (iterative, error), _, (quick, sparse) = result
        cells = [f"{seconds:.1f} | {part:.3%}" for seconds, part in result]
        cells.insert(0, "{:.1f} | {:.3%}".format(*published) if published else " | ")
        ratios = [f"{published[0] / quick:.1f}" if published else "", f"{iterative / quick:.1f}"]
        ratios += [f"{sparse / published[1]:.3f}" if published else "", f"{sparse / error:.3f}"]
        lines.append(f"| {n_clusters} | {' | '.join(cells)} | {' | '.join(ratios)} |")
    return lines


def scenes_table(folder, *names):
    """`prt bench compress` on other scenes, three budgets of each method; rows are kept."""
    folder, result = Path(folder), {}
    for name in names or SCENES:
        kept = folder / f"compress_{name}.json"
        if not kept.exists():
            bake = folder / f"{name}.prt"
            if name in MODELS:
                settings = prt_core.BakeSettings(caster="embree")
                run(prt_core.bake_steps(measuring_scene(name), bake, settings))
            else:
                (blend,) = (ROOT / "blend_scenes").glob(f"{name}*.blend")
                _run("-m", "prt_core", "bake", blend, "-o", bake, "--caster", "embree")
            budget_numbers = map(str, BUDGETS)
            rows = _run("-m", "prt_core", "bench", "compress", bake, "-o", folder / name,
                        "--budgets", *budget_numbers, "--json")  # fmt: skip
            kept.write_text(rows)
        result[name] = json.loads(kept.read_text())
    sizes = ", ".join(f"{name} {rows[0]['points']:,} points" for name, rows in result.items())
    lines = [
        f"Other scenes ({sizes}), as above: MB; ms in the median; relit error in the mean, and in "
        "the worst of 64 lights.",
        "",
        f"| method | {' | '.join(result)} |",
        "|---" * (1 + len(result)) + "|",
    ]
    for kind in dict.fromkeys(row["method"] for rows in result.values() for row in rows):
        cells = [[row for row in rows if row["method"] == kind] for rows in result.values()]
        for index in range(max(map(len, cells))):
            mine = [rows[index] if index < len(rows) else None for rows in cells]
            named = next(row for row in mine if row)
            text = [
                "" if row is None else
                f"{row['bytes'] / 1e6:.1f}; {row['ms_median']:.1f}; {row['relit_l2_mean']:.2%}, "
                f"{row['relit_l2_worst']:.2%}" for row in mine
            ]  # fmt: skip
            lines.append(f"| {_shortly(named)} | {' | '.join(text)} |")
    return lines


def _shortly(row):
    """A method and the setting that makes its size, whatever else it has."""
    names = ("n_components", "error", "n_terms", "order", "n_clusters")
    said = [f"{name} {row['settings'][name]}" for name in names if name in row["settings"]]
    return f"{row['method']}, {said[0]}" if said else row["label"]


def bounces_table(path):
    """All bounces in the compressed rows, against direct rows and K when relighting."""
    from prt_core.compress import Task, method_named

    bake = prt_core.load(path)
    transport, method = bake.transport, method_named("cpca")
    lights = [image.to_cube_map(bake.cube_map, turn)
              for image in images().values() for turn in TURNS]  # fmt: skip
    truth = [transport.radiance(light) for light in lights]
    lines = [
        f"Where the bounces are: clustered PCA of all of them, or of the direct light with K at "
        f"run time; {transport.n_points:,} points, {len(lights)} lights.",
        "",
        "| components | bounces | MB | of it K | ms median (worst) | relit mean | relit worst |",
        "|---" * 7 + "|",
    ]
    whole = Task.of(transport, bake.scene.points)
    for budget in BUDGETS[:2]:
        for inside in (True, False):
            task = whole
            if not inside:
                task = replace(whole, rows=TransportRows(transport, rank=0))
            model = method.budgets(task)[budget]
            run(model.fit_steps(task.rows))
            method.finish(model, task)
            quick = method.relighter(model, transport)

            def relit(light, quick=quick, inside=inside):
                received = quick.product(light)
                received = received if inside else transport.with_bounces(received)
                return transport.exit_radiance(received).toward()

            errors, spent = [], []
            for light, wanted in zip(lights, truth, strict=True):
                start = time.perf_counter()
                result = relit(light)
                spent.append(1e3 * (time.perf_counter() - start))
                errors.append(relative_l2(result, wanted))
            k = transport.gather
            of_k = 0 if inside else (k.data.nbytes + k.indices.nbytes + k.indptr.nbytes) / 1e6
            lines.append(
                f"| {model.n_components} | {'compressed' if inside else 'K'} | "
                f"{model.nbytes / 1e6 + of_k:.1f} | {of_k:.1f} | {np.median(spent):.1f} "
                f"({max(spent):.1f}) | {np.mean(errors):.2%} | {max(errors):.2%} |"
            )
    return lines


def frames_table(blend, path, n_frames=48):
    """The whole way of a frame in Blender: turn, relight, corners, the colour attribute."""
    from prt_core.blender.colours import write_all
    from prt_core.blender_access import open_blend
    from prt_core.relight.relighter import Relighter

    open_blend(blend)
    import bpy

    bake, image = prt_core.load(path), images()["city"]
    quick = Relighter(bake, form="compressed")
    stages = {"turn and relight": [], "corners": [], "attribute": [], "evaluate": []}
    for frame in range(n_frames + 2):
        marks = [time.perf_counter()]
        radiance = quick.radiance(image, rotation=7.5 * frame)
        marks.append(time.perf_counter())
        colours = bake.colours(radiance)
        marks.append(time.perf_counter())
        write_all(bake.scene, colours)
        marks.append(time.perf_counter())
        for layer in bpy.context.scene.view_layers:
            layer.update()
        marks.append(time.perf_counter())
        if frame >= 2:
            for values, spent in zip(stages.values(), np.diff(marks), strict=True):
                values.append(1e3 * spent)
    total = np.sum(list(stages.values()), axis=0)
    attributes = quick.compressed().attributes
    corners = sum(len(part) for part in colours.values())
    parts = ", ".join(f"{name} {np.median(v):.1f}" for name, v in stages.items())
    return [
        f"A frame in Blender without a window, {len(radiance):,} points, {corners:,} corners, "
        f"{attributes['method']} of {attributes['bytes'] / 1e6:.0f} MB: {np.median(total):.1f} ms "
        f"in the median, {np.percentile(total, 95):.1f} ms at 95 % ({parts} ms): "
        f"{1e3 / np.median(total):.0f} frames a second.",
    ]


def memory_table(blend, path, resolution=64):
    """What `prt compress --method wavelet4d` holds while it compresses a large matrix."""
    _run("-m", "prt_core", "bake", blend, "-o", path, "--resolution", resolution,
         "--caster", "embree", "--restart")  # fmt: skip
    attributes = json.loads(
        _run("-m", "prt_core", "compress", path, "--method", "wavelet4d", "--json").splitlines()[-1]
    )
    bake = prt_core.load(path)
    n_points, n_directions = bake.transport.n_points, bake.cube_map.n_directions
    return [
        f"`prt compress --method wavelet4d` at 6 x {resolution} x {resolution}: {n_points:,} "
        f"points, a matrix of {4 * 3 * n_points * n_directions / 1e9:.1f} GB in "
        f"{attributes['seconds']:.0f} s with a peak of {attributes['peak_bytes'] / 1e9:.2f} GB; "
        f"{attributes['bytes'] / 1e6:.1f} MB, relit colours "
        f"{attributes['error']:.2%} off in the mean of Blender's eight.",
    ]


def sections(path, blend, work):
    """{title: what measures it} of a bake of `blend`, kept in a folder; the plot goes to docs/."""
    large = work / "large_64.prt"

    def methods():
        if not path.exists():
            _run("-m", "prt_core", "bake", blend, "-o", path, "--caster", "embree")
        rows = _run("-m", "prt_core", "bench", "compress", path, "-o", work / "compress", "--json")
        shutil.copy(work / "compress" / "error.png", ROOT / "docs" / "compression.png")
        return method_table(json.loads(rows))

    def frames():
        _run("-m", "prt_core", "compress", path, "--method", "cpca", "--tolerance", "0.005")
        # Blender tells of the file it read, too.
        return _run(__file__, "frames", blend, path).splitlines()[-1:]

    return {
        "Every method": methods,
        "Other scenes": lambda: [_run(__file__, "scenes", work)] if data_folder() else [],
        "Where the bounces are": lambda: [_run(__file__, "bounces", path)],
        "A frame in Blender": frames,
        "A fine cube map": lambda: [_run(__file__, "memory", blend, large)],
        "Light in few wavelets": lambda: [
            _run(__file__, "haar", path), "", _run(__file__, "haar", large)
        ],
        "Clusters of a sparse bake": lambda: (
            [_run(__file__, "sparse", "bunny")] if data_folder() else []
        ),
    }  # fmt: skip


def _run(*arguments):
    """Standard output of a Python of its own: memory and threads of one do not tell on another."""
    done = subprocess.run(
        [sys.executable, *map(str, arguments)], capture_output=True, text=True, cwd=ROOT, check=True
    )
    return done.stdout.strip()


def method_table(rows):
    """The rows of `prt bench compress` as Markdown."""
    dense, exact = rows[0]["ms_median"], rows[1]["ms_median"]
    lines = [
        f"`prt bench compress`: {rows[0]['points']:,} points, {rows[0]['directions']:,} "
        "directions, RGB, all bounces, eight HDRIs at eight rotations. Relit errors are relative "
        "L2 against the exact bake; the matrix' error is estimated by white lights; seam: the "
        "largest jump of the error across a cluster's border, relative to the mean colour.",
        "",
        "![Error against size, time of a light and time to compress](../compression.png)",
        "",
        "| method | MB | bits / coefficient | s | ms median (worst) | dense / | bits / | matrix | "
        "relit mean | relit worst | PSNR dB | seam |",
        "|---" * 12 + "|",
    ]
    for row in rows:
        seconds, matrix, seam, psnr = (
            "" if row.get(key) is None else format(row[key], style)
            for key, style in (
                ("seconds", ".1f"),
                ("matrix_l2", ".2%"),
                ("seam", ".1%"),
                ("relit_psnr", ".1f"),
            )
        )
        lines.append(
            f"| {row['label']} | {row['bytes'] / 1e6:.1f} | {row['bits_a_coefficient']:.3f} | "
            f"{seconds} | {row['ms_median']:.1f} ({row['ms_worst']:.1f}) | "
            f"{dense / row['ms_median']:.0f} | {exact / row['ms_median']:.0f} | {matrix} | "
            f"{row['relit_l2_mean']:.2%} | {row['relit_l2_worst']:.2%} | {psnr} | {seam} |"
        )
    return lines


if __name__ == "__main__":
    kinds = {"haar": haar_table, "sparse": sparse_table, "frames": frames_table,
             "scenes": scenes_table, "bounces": bounces_table, "memory": memory_table}  # fmt: skip
    print("\n".join(kinds[sys.argv[1]](*sys.argv[2:])))
