"""Adaptive 4D wavelets against 2D and full 4D ones, after Cheslack-Postava et al. (2007).

python tests/benchmarks/wavelet4d_tables.py fit SCENE OBJECT [PART]   compress and keep, untimed
python tests/benchmarks/wavelet4d_tables.py time SCENE OBJECT         milliseconds, in one run
python tests/benchmarks/wavelet4d_tables.py filters SCENE OBJECT      row filters
python tests/benchmarks/wavelet4d_tables.py density SCENE            model at more and fewer points
python tests/benchmarks/wavelet4d_tables.py image SCENE KIND N [ERROR ...]   column filters
python tests/benchmarks/wavelet4d_tables.py image_times SCENE KIND N [ERROR [MODE ...]]   times
python tests/benchmarks/wavelet4d_tables.py write             what is kept, into docs/benchmarks

`density` halves every edge of the model once, and leaves out points in its hierarchy's order.
KIND is `camera` (N x N pixels of 2 x 2 points), `ground` (its geometry image, by UVs) or `model`
(its geometry image, over the sphere; and how far its colours are from those of the vertices).
SCENE is a measuring scene's name or the path of a bake, OBJECT the name of an object or `all`.
PART is a mode, or `bits` (what quantising adds at the same limit). What is found is kept under
PRT_CACHE/wavelet4d, so that fits and timings may run at different times.
"""

import json
import os
import pickle
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

import prt_core  # noqa: E402
from prt_core.bake import BakeSettings, bake_steps  # noqa: E402
from prt_core.bake.images import ImageSettings, image_steps  # noqa: E402
from prt_core.basis import WAVELETS, ImageWavelet, PointMultiwavelet, haar_areas  # noqa: E402
from prt_core.blender.measuring import (  # noqa: E402
    GROUND,
    data_folder,
    ground_arrays,
    measuring_scene,
    model_arrays,
    smooth_mesh,
)
from prt_core.compress import ImageRows, SomeRows, TransportRows, Wavelet4D  # noqa: E402
from prt_core.compress.wavelets.column_coder import ColumnCoder  # noqa: E402
from prt_core.compress.wavelets.sparse_columns import column_bytes  # noqa: E402
from prt_core.errors import PRTError  # noqa: E402
from prt_core.light import EnvironmentMap  # noqa: E402
from prt_core.runtime.progress import run  # noqa: E402
from prt_core.scene import auto_camera  # noqa: E402
from prt_core.scene.images.closed_surface import closed_surface  # noqa: E402
from prt_core.scene.images.spherical import spherical_positions  # noqa: E402
from prt_core.sphere import octahedral_square  # noqa: E402
from prt_core.transport import ExitRadiance  # noqa: E402
from tests.benchmarks.sections import write_sections  # noqa: E402

CACHE = Path(os.environ.get("PRT_CACHE", "/tmp")) / "wavelet4d"
ERRORS = (0.05, 0.02, 0.01)
MODES = ("adaptive", "2d", "4d")
FRAMES = 15
# What a light may lose of the colours when it is cut to its best wavelets.
CUTS = {"all": 0.0, "cut": None}
# Blender's own, of different kinds; each as it is and turned.
HDRIS, TURNS = ("city", "courtyard", "interior", "sunset"), (0.0, 130.0)
PAGE = "wavelets"


def baked(name, halvings=0):
    """A bake of all bounces at 32 x 32: of a measuring scene, or the one at a path."""
    if name.endswith(".prt"):
        return prt_core.load(name)
    path = CACHE / (f"{name}-halved{halvings}.prt" if halvings else f"{name}.prt")
    scene = measuring_scene(name, halvings=halvings)
    run(bake_steps(scene, path, BakeSettings(caster="embree")))
    return prt_core.load(path)


def prepared(scene, item, halvings=0):
    bake = baked(scene, halvings)
    points = bake.scene.points
    names = [o.name for o in bake.scene.objects]
    mine = np.arange(len(points))
    if item != "all":
        mine = np.flatnonzero(points.object_index == names.index(item))
    place = points.positions[mine], points.normals[mine], points.object_index[mine]
    columns = PointMultiwavelet(*place)
    return bake, mine, SomeRows(TransportRows(bake.transport), mine), columns


def fit(scene, item, part=None):
    _, _, rows, columns = prepared(scene, item)
    first = Wavelet4D(columns)
    with run(first.columns_steps(rows)) as file:
        for mode in MODES if part is None else [m for m in MODES if m == part]:
            for error in ERRORS:
                began = time.perf_counter()
                model = Wavelet4D(columns, error=error, mode=mode)
                try:
                    run(model.fit_columns_steps(rows, file))
                except PRTError as reason:
                    print(scene, item, mode, error, reason, flush=True)
                    continue
                keep(scene, item, f"{mode}_{error}", model, time.perf_counter() - began)
        if part in (None, "bits"):
            bits(scene, item, columns, file)


def bits(scene, item, columns, file):
    """The same terms, as floats and quantised in several ways."""
    result = {}
    for error in ERRORS:
        model = pickle.loads(kept(scene, item, f"adaptive_{error}").read_bytes())
        row = {}
        for name, settings in {
            "floats": (None, "root", False),
            "9 bits": (9, "root", False),
            "9 bits, dithered": (9, "root", True),
            "9 bits, by level": (9, "levels", False),
            "9 bits, by level, dithered": (9, "levels", True),
            "9 bits, linear": (9, "none", False),
            "10 bits": (10, "root", False),
            "8 bits": (8, "root", False),
        }.items():
            coder = ColumnCoder(columns, 0, columns.depth, *settings, 1 << 29, 0)
            _, row[name], _ = run(coder.all_steps(file, model["limit"]))
        result[error] = row
        print(scene, item, error, {k: f"{v:.4%}" for k, v in row.items()}, flush=True)
    kept(scene, item, "bits", "json").write_text(json.dumps(result))


def filters(scene, item):
    """Bytes at 2 % with each row filter."""
    _, _, rows, columns = prepared(scene, item)
    for name in ("haar", "d4", "d6", "d8"):
        model = Wavelet4D(columns, rows=name, error=0.02).fit(rows)
        print(f"{scene} {item} rows {name}: {model.nbytes / 1e6:.2f} MB", flush=True)


def density(scene):
    """Bytes of the model at 2 %, adaptive and 2D, at a quarter of its points to four times all."""
    result = []
    for halvings, share in ((0, 4), (0, 2), (0, 1), (1, 1)):
        bake, mine, rows, columns = prepared(scene, "model", halvings)
        if share > 1:
            # One leaf of each small patch.
            subset = np.sort(columns.order[share // 2 :: share])
            rows = SomeRows(rows, subset)
            points = bake.scene.points
            columns = PointMultiwavelet(
                points.positions[mine[subset]], points.normals[mine[subset]]
            )
        sizes = []
        with run(Wavelet4D(columns).columns_steps(rows)) as file:
            for mode in ("adaptive", "2d"):
                model = run(Wavelet4D(columns, error=0.02, mode=mode).fit_columns_steps(rows, file))
                sizes.append(model.nbytes)
        result.append((rows.n_points, *sizes))
        print(scene, "points, adaptive, 2d bytes", *result[-1], flush=True)
    kept(scene, "model", "density", "json").write_text(json.dumps(result))


def image_path(name, kind, size):
    return CACHE / f"{name}-{kind}{size}.prt"


def image_bake(name, kind, size):
    """A bake of all bounces with an image of a measuring scene, made where it is not kept."""
    path = image_path(name, kind, size)
    scene = measuring_scene(name)
    meshes = [flat_ground(), model_mesh(name)]
    asked = ((int(size),) * 2, 2, None) if kind == "camera" else (None, 1, (kind, int(size)))
    scene = run(image_steps(scene, meshes, auto_camera(scene), "embree", ImageSettings(*asked)))
    print(*scene.messages, sep="\n", file=sys.stderr, flush=True)
    run(bake_steps(scene, path, BakeSettings(caster="embree")))
    return prt_core.load(path)


def image_rows(bake):
    """`Rows` of the image's pixels."""
    return ImageRows(TransportRows(bake.transport), bake.scene.image, bake.transport.albedo)


def image(name, kind, size, *errors):
    """Bytes of an image in each column transform, the pixels' own hierarchy among them."""
    path = image_path(name, kind, size)
    bake = image_bake(name, kind, size)
    if kind == "model":
        far = remeshed(bake, model_mesh(name))
        path.with_suffix(".remesh.json").write_text(json.dumps(far))
        print(path.stem, "remeshed", far, flush=True)
    shown, points = bake.scene.image, bake.scene.points
    rows = image_rows(bake)
    shape = shown.height, shown.width
    place = [shown.pixels(a).reshape(-1, 3) for a in (points.positions, points.normals)]
    orders = (
        {name: ImageWavelet(shape, name) for name in WAVELETS},
        {"hierarchy": PointMultiwavelet(*place)},
    )
    kept_rows = path.with_suffix(".image.json")
    result = json.loads(kept_rows.read_text()) if kept_rows.exists() else []
    done = [(row[0], row[1], row[-1]) for row in result]
    for columns in orders:
        # Turned once for all transforms that keep the pixels' order.
        with run(Wavelet4D(next(iter(columns.values()))).columns_steps(rows)) as file:
            errors = [float(error) for error in errors] or [0.02]
            for error in errors:
                for name, transform in columns.items():
                    # All filters are compared once, where that does not take hours.
                    few = error != errors[0] or int(size) > 256
                    if few and name not in ("haar", "9/7", "hierarchy"):
                        continue
                    for mode in ("adaptive", "4d") + (("2d",) if name == "haar" else ()):
                        if (name, mode, error) in done:
                            continue
                        model = Wavelet4D(transform, error=error, mode=mode)
                        run(model.fit_columns_steps(rows, file))
                        # The order of the pixels is that of the image, or counted.
                        row = name, mode, model.nbytes, model.n_coefficients_, model.matrix_error_
                        result.append((*row, error))
                        print(path.stem, *row, flush=True)
                        kept_rows.write_text(json.dumps(result))


def remeshed(bake, mesh):
    """How far colours of the model, read from its geometry image, are from its vertices' own.

    Returns
    -------
    list of float
        Relative L2 over the vertices, for each HDRI and turn.
    """
    point, u, v = vertex_texels(bake, mesh)
    result = []
    for light in studio_lights(bake):
        radiance = bake.transport.radiance(light)
        read, truth = read_texels(bake.image(radiance), u, v), radiance[point]
        result.append(float(np.linalg.norm(read - truth) / np.linalg.norm(truth)))
    return result


def vertex_texels(bake, mesh):
    """Bake points of a model's vertices, and their (u, v) in its geometry image over the sphere."""
    surface = closed_surface(mesh.name, mesh.vertices, mesh.corner_vertex[mesh.solid_triangles()])
    place = spherical_positions(mesh.name, surface.vertices, surface.faces)
    item = next(item for item in bake.scene.objects if item.name == mesh.name)
    vertex = surface.of_vertex[item.corner_vertex]
    used = (item.corner_point >= 0) & (vertex >= 0)
    point, first = np.unique(item.corner_point[used], return_index=True)
    return point, *octahedral_square(place[vertex[used][first]])


def read_texels(picture, u, v):
    """(n, 3) of a geometry image over the sphere, with a linear filter."""
    # Past its border the square goes on as it came.
    picture = np.concatenate([picture[:1, ::-1], picture, picture[-1:, ::-1]])
    picture = np.concatenate([picture[::-1, :1], picture, picture[::-1, -1:]], axis=1)
    size = len(picture) - 2
    at = np.stack([(1 - v) * size + 0.5, u * size + 0.5])
    return np.transpose(
        [map_coordinates(part, at, order=1) for part in np.moveaxis(picture, -1, 0)]
    )


def studio_lights(bake):
    """Each of HDRIS at each of TURNS, on the texels of a bake."""
    import bpy

    folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    for name in HDRIS:
        environment = EnvironmentMap.read(folder / f"{name}.exr")
        for turn in TURNS:
            yield environment.to_cube_map(bake.cube_map, rotation=turn)


def model_mesh(name):
    """The model of a measuring scene."""
    return smooth_mesh("model", *model_arrays(name), (0.7, 0.65, 0.6))


def flat_ground():
    """The ground of the measuring scenes with the texture coordinates of its square."""
    mesh = smooth_mesh("ground", *ground_arrays(GROUND), (0.5, 0.5, 0.5))
    return replace(mesh, corner_uv=mesh.vertices[mesh.corner_vertex][:, :2] / 4 + 0.5)


def kept(scene, item, name, kind="pkl"):
    CACHE.mkdir(parents=True, exist_ok=True)
    return CACHE / f"{Path(scene).stem}-{item}-{name}.{kind}"


def keep(scene, item, name, model, seconds):
    state = {**model.state(), "limit": model.limit_}
    kept(scene, item, name).write_bytes(pickle.dumps(state))
    row = {
        "bytes": model.nbytes,
        "terms": model.n_coefficients_,
        "error": model.matrix_error_,
        "seconds": seconds,
        "levels": levels(model),
    }
    kept(scene, item, name, "json").write_text(json.dumps(row))
    print(scene, item, name, {k: v for k, v in row.items() if k != "levels"}, flush=True)


def levels(model):
    """(mean depth, mean bytes, share of columns with terms) of luminance, by level of rows."""
    level, _ = haar_areas(model.resolution_)
    counts, depths = model.counts_[: len(level)], model.depths_[: len(level)]
    sizes, _ = column_bytes(counts, model.n_points_, model.bits)
    return [
        (
            float(depths[(level == k) & (counts > 0)].mean()) if counts[level == k].any() else 0.0,
            float(sizes[level == k].mean()),
            float((counts[level == k] > 0).mean()),
        )
        for k in range(level.max() + 1)
    ]


def turning_courtyard(cube_map):
    """A light for each frame."""
    import bpy

    folder = Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world"
    environment = EnvironmentMap.read(folder / "courtyard.exr")
    return [environment.to_cube_map(cube_map, rotation=24.0 * k) for k in range(FRAMES)]


def milliseconds(models, lights):
    """{name: {cut: median milliseconds a frame}}; the first light comes twice, to warm up.

    Frame by frame and method by method: what else the machine does hits all alike.
    """
    spent = {name: {cut: [] for cut in CUTS} for name in models}
    for light in [lights[0], *lights]:
        for name, model in models.items():
            for cut, model.light_error in CUTS.items():
                began = time.perf_counter()
                model.product(light)
                spent[name][cut].append(1e3 * (time.perf_counter() - began))
    return {
        name: {cut: float(np.median(result[1:])) for cut, result in cuts.items()}
        for name, cuts in spent.items()
    }


def image_times(name, kind, size, error=0.02, *modes):
    """Milliseconds a frame of an image that `image` baked, in Haar columns; all modes, or some."""
    path = image_path(name, kind, size)
    bake = image_bake(name, kind, size)
    shown, rows = bake.scene.image, image_rows(bake)
    columns = ImageWavelet((shown.height, shown.width), "haar")
    models = {}
    with run(Wavelet4D(columns).columns_steps(rows)) as file:
        for mode in modes or MODES:
            model = Wavelet4D(columns, error=float(error), mode=mode)
            models[mode] = run(model.fit_columns_steps(rows, file))
    spent = milliseconds(models, turning_courtyard(bake.cube_map))
    print(path.stem, spent, flush=True)
    path.with_suffix(".image_ms.json").write_text(json.dumps([float(error), spent]))


def times(scene, item):
    """Median milliseconds a frame of a turning courtyard: every wavelet, and the default cut."""
    bake = baked(scene)
    lights = turning_courtyard(bake.cube_map)
    points = bake.scene.points
    mine = np.arange(len(points))
    if item != "all":
        names = [o.name for o in bake.scene.objects]
        mine = np.flatnonzero(points.object_index == names.index(item))
    truth, albedo = bake.transport.radiance(lights[0])[mine], bake.transport.albedo[mine]
    models = {}
    for mode in MODES:
        for error in ERRORS:
            state = pickle.loads(kept(scene, item, f"{mode}_{error}").read_bytes())
            models[f"{mode}_{error}"] = Wavelet4D.from_state(state)
    spent = milliseconds(models, lights)
    for name, model in models.items():
        row = {f"ms_{cut}": spent[name][cut] for cut in CUTS}
        for cut, model.light_error in CUTS.items():
            result = ExitRadiance(model.product(lights[0]), albedo).toward()
            row[f"relit_{cut}"] = float(np.linalg.norm(result - truth) / np.linalg.norm(truth))
        row["wavelets"] = [int(model.choose(light).any(axis=1).sum()) for light in lights]
        kept(scene, item, name, "ms.json").write_text(json.dumps(row))
        print(scene, item, name, row, flush=True)


def measured():
    """Fit and time what `make bench` measures; the rest of the tables is made by hand."""
    if data_folder():
        for item in ("model", "ground"):
            fit("bunny", item)
            times("bunny", item)
        image("bunny", "ground", 256)
        image("bunny", "model", 256, *ERRORS)
        image_times("bunny", "ground", 256)
        image_times("bunny", "model", 256)
    return sizes_table()


def write():
    """The page, from all that is kept."""
    write_sections(PAGE, sections())


def sections(measure=False):
    """{title: what makes its lines of all that is kept}; the first one measures where asked to."""
    return {
        "Sizes and times": measured if measure else sizes_table,
        "Columns by level": levels_table,
        "Fewer and more points": density_table,
        "What quantising adds": bits_table,
        "Images": images_table,
        "A new light for images": image_times_table,
        "Colours read from an image": remesh_lines,
    }


def kept_names():
    """Scene and object of every fit that is kept, as in names of files."""
    files = sorted(CACHE.glob("*-adaptive_0.02.json"))
    return [f.name.removesuffix("-adaptive_0.02.json") for f in files]


def sizes_table():
    rows = [row for name in kept_names() for row in _sizes(name)]
    return rows and [
        "Bytes at equal relative L2 of the matrix, quantisation included. The columns of meshes "
        "are transformed in the points' own hierarchy. Milliseconds of a new light in all its "
        "wavelets, and in those whose loss would add more than a tenth of the matrix' error to its "
        "colours, as is the default (so many of them); in brackets the error of the colours.",
        "",
        "| scene | error | adaptive MB | 2D MB | 4D MB | 2D / adaptive | 4D / adaptive "
        "| ms, all: adaptive, 2D, 4D | ms, cut: adaptive, 2D, 4D | wavelets |",
        "|---" * 10 + "|",
        *rows,
    ]


def _sizes(name):
    for error in ERRORS:
        rows = [read(name, f"{mode}_{error}", "json") for mode in MODES]
        ms = [read(name, f"{mode}_{error}", "ms.json") for mode in MODES]
        if not all(rows):
            continue
        sizes = [row["bytes"] / 1e6 for row in rows]
        printed = " | ".join(f"{size:.2f}" for size in sizes)
        cells = [""] * 3
        if all(ms):
            cells = [
                ", ".join(f"{m[f'ms_{cut}']:.0f} ({m[f'relit_{cut}']:.2%})" for m in ms)
                for cut in CUTS
            ]
            cells.append(f"{np.median(ms[0]['wavelets']):.0f}")
        yield (
            f"| {name.replace('-', ', ')} | {error:.0%} | {printed} | {sizes[1] / sizes[0]:.2f} "
            f"| {sizes[2] / sizes[0]:.3f} | {' | '.join(cells)} |"
        )


def levels_table():
    rows = []
    for name in kept_names():
        for mode in ("adaptive", "2d"):
            row = read(name, f"{mode}_0.02", "json")
            if row:
                depths, sizes, _ = zip(*row["levels"], strict=True)
                rows.append(
                    f"| {name.replace('-', ', ')} | {mode} | "
                    f"{', '.join(f'{d:.1f}' for d in depths)} "
                    f"| {'; '.join(f'{s:,.0f}' for s in sizes)} |"
                )
    return rows and [
        "By level of the row's wavelet, coarsest first, at 2 %:",
        "",
        "| scene | mode | mean depth | bytes a column |",
        "|---|---|---|---|",
        *rows,
    ]


def density_table():
    rows = [
        f"| {path.name.split('-')[0]} | {n:,} | {adaptive / 1e6:.2f} | {plain / 1e6:.2f} "
        f"| {plain / adaptive:.2f} |"
        for path in sorted(CACHE.glob("*-model-density.json"))
        for n, adaptive, plain in json.loads(path.read_text())
    ]
    return rows and [
        "The same models in fewer and in more points, at 2 %:",
        "",
        "| model | points | adaptive MB | 2D MB | 2D / adaptive |",
        "|---" * 5 + "|",
        *rows,
    ]


def bits_table():
    rows, ways = [], []
    for name in kept_names():
        for error, row in (read(name, "bits", "json") or {}).items():
            ways = ways or [way for way in row if way != "floats"]
            added = " | ".join(f"{row[way] / row['floats'] - 1:+.1%}" for way in ways)
            rows.append(
                f"| {name.replace('-', ', ')}, {float(error):.0%} | {row['floats']:.2%} | {added} |"
            )
    return rows and [
        "What quantising adds to the error of the same terms:",
        "",
        f"| scene | floats | {' | '.join(ways)} |",
        "|---" * (2 + len(ways)) + "|",
        *rows,
    ]


def images_table():
    rows = [
        f"| {path.name.removesuffix('.image.json')} | {name} | {mode} | {size / 1e6:.2f} "
        f"| {terms:,} | {error:.2%} |"
        for path in sorted(CACHE.glob("*.image.json"))
        for name, mode, size, terms, error, _ in sorted(
            json.loads(path.read_text()), key=lambda row: -row[-1]
        )
    ]
    return rows and [
        "Images in each column transform (`ground` by its UV map, `model` over the sphere, "
        "`camera` with 2 x 2 points a pixel; the `hierarchy` is that of the same texels, and "
        "holds the order and the features of the points, up to 12 bytes each):",
        "",
        "| image | transform | mode | MB | terms | error |",
        "|---|---|---|---|---|---|",
        *rows,
    ]


def image_times_table():
    rows = []
    for path in sorted(CACHE.glob("*.image_ms.json")):
        error, spent = json.loads(path.read_text())
        printed = [", ".join(f"{spent[m][cut]:.0f}" for m in MODES if m in spent) for cut in CUTS]
        named = path.name.removesuffix(".image_ms.json")
        rows.append(f"| {named} | {error:.0%} | {' | '.join(printed)} |")
    return rows and [
        "Milliseconds of a new light for images in Haar columns:",
        "",
        "| image | error | all wavelets: adaptive, 2D, 4D | cut: adaptive, 2D, 4D |",
        "|---" * 4 + "|",
        *rows,
    ]


def remesh_lines():
    lines = []
    for path in sorted(CACHE.glob("*.remesh.json")):
        far = json.loads(path.read_text())
        lines += [
            "",
            f"Relit colours of the vertices, read from {path.name.removesuffix('.remesh.json')} "
            f"with a linear filter, are {np.mean(far):.2%} from their own (relative L2, mean of "
            f"{', '.join(HDRIS)} at {len(TURNS)} rotations; worst {max(far):.2%}).",
        ]
    return lines


def read(name, setting, kind):
    path = CACHE / f"{name}-{setting}.{kind}"
    return json.loads(path.read_text()) if path.exists() else None


if __name__ == "__main__":
    known = {"fit": fit, "time": times, "filters": filters, "density": density}
    known |= {"image": image, "image_times": image_times, "write": write}
    known[sys.argv[1]](*sys.argv[2:])
