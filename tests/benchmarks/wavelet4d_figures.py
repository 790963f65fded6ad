"""Figures 7, 9 and 10 of Cheslack-Postava et al. (2007), of our wavelets on our scenes.

python tests/benchmarks/wavelet4d_figures.py errors    figure 7: error against terms kept
python tests/benchmarks/wavelet4d_figures.py terms     figure 9: frames by wavelets of the light
python tests/benchmarks/wavelet4d_figures.py mesh      figure 10: a geometry image on its mesh
python tests/benchmarks/wavelet4d_figures.py frames    4D frames against 2D ones, and what they read

Each writes its section of docs/benchmarks, the first three with a picture. Forms that were fitted
are kept under PRT_CACHE/wavelet4d, as those of `wavelet4d_tables.py`.
"""

import json
import pickle
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from prt_core.basis import ImageWavelet, PointMultiwavelet  # noqa: E402
from prt_core.blender.measuring import data_folder  # noqa: E402
from prt_core.compress import SomeRows, TransportRows, Wavelet4D  # noqa: E402
from prt_core.errors import PRTError  # noqa: E402
from prt_core.evaluate import contact_sheet, to_srgb, write_png  # noqa: E402
from prt_core.evaluate.report import curve_plot  # noqa: E402
from prt_core.evaluate.view import CameraRays  # noqa: E402
from prt_core.runtime.progress import run  # noqa: E402
from tests.benchmarks.sections import write_sections  # noqa: E402
from tests.benchmarks.wavelet4d_tables import (  # noqa: E402
    CACHE,
    FRAMES,
    baked,
    image_bake,
    image_rows,
    model_mesh,
    read_texels,
    studio_lights,
    turning_courtyard,
    vertex_texels,
)

PAGE = "wavelets"
PICTURES = ROOT / "docs"
PUBLISHED = {"scaling": "levels", "dither": True}
# What is compared in figure 7: (line, settings).
LINES = (
    ("adaptive 4D", {"mode": "adaptive"}),
    ("full 4D", {"mode": "4d"}),
    ("2D", {"mode": "2d"}),
    ("adaptive 4D, quantised as published", {"mode": "adaptive", **PUBLISHED}),
    ("full 4D, quantised as published", {"mode": "4d", **PUBLISHED}),
)
ERRORS = (0.1, 0.05, 0.02, 0.01)
# Of figures 7 and 9: the model on which 4D is worth about as much as published.
SUBJECT = "dragon", "model"
N_WAVELETS = (16, 32, 64, 128, 256, 512, 1024, 2048)
GEOMETRY_TERMS = 256
# Of the frames that are compared: scene and what of it; errors of the matrix.
PAIRS = (("bunny", "model"), ("dragon", "model"))
PAIR_ERRORS = (0.05, 0.02, 0.01)
REPEATS = 3
N_PAIRS = REPEATS * FRAMES


def subject(name, kind, wavelet):
    """Bake, rows and transform of columns of a model or of an image (`camera256`, `model256`)."""
    if kind != "model":
        size = "".join(filter(str.isdigit, kind))
        bake = image_bake(name, kind.removesuffix(size), size)
        image = bake.scene.image
        return bake, image_rows(bake), ImageWavelet((image.height, image.width), wavelet)
    bake = baked(name)
    points = bake.scene.points
    names = [item.name for item in bake.scene.objects]
    mine = np.flatnonzero(points.object_index == names.index("model"))
    place = points.positions[mine], points.normals[mine], points.object_index[mine]
    return bake, SomeRows(TransportRows(bake.transport), mine), PointMultiwavelet(*place)


class Forms:
    """Fitted forms of one subject, each kept by its settings."""

    def __init__(self, name, kind, wavelet="haar"):
        self.name = f"{name}-{kind}"
        self.bake, self.rows, self.columns = subject(name, kind, wavelet)
        self._file = None

    def fitted(self, **settings):
        """A `Wavelet4D`; None where the error is out of reach of its bits."""
        label = "_".join(f"{key}={value}" for key, value in sorted(settings.items()))
        kept = CACHE / f"{self.name}.{label}.figure.pkl"
        if not kept.exists():
            if self._file is None:
                self._file = run(Wavelet4D(self.columns).columns_steps(self.rows))
            model = Wavelet4D(self.columns, **settings)
            try:
                state = run(model.fit_columns_steps(self.rows, self._file)).state()
            except PRTError as error:
                state = str(error)
            kept.write_bytes(pickle.dumps(state))
            print(self.name, label, state if isinstance(state, str) else model.nbytes, flush=True)
        state = pickle.loads(kept.read_bytes())
        return None if isinstance(state, str) else Wavelet4D.from_state(state)


def errors():
    """Figure 7."""
    rows, forms = [], Forms(*SUBJECT)
    entries = forms.rows.n_points * forms.rows.n_directions * forms.rows.n_outputs
    for line, settings in LINES:
        for error in ERRORS:
            model = forms.fitted(error=error, **settings)
            if model is None:
                continue
            rows.append(
                {
                    "subject": forms.name,
                    "line": line,
                    "wanted": error,
                    "terms": 100 * model.n_coefficients_ / entries,
                    "error": 100 * model.matrix_error_,
                }
            )
    labels = {"terms": "terms kept, % of the matrix", "error": "relative L2 of the matrix, %"}
    picture = curve_plot(rows, "terms", "error", "subject", "line", labels)
    (PICTURES / "wavelet4d_errors.png").write_bytes(picture)
    lines = [
        f"After figure 7 (`wavelet4d_figures.py errors`): terms kept of {forms.name}, "
        f"{forms.rows.n_points:,} points, against the relative L2 of the matrix, quantisation "
        "included. Columns in the points' own hierarchy, 9 bits. In the table per cent of the "
        "matrix' entries that are kept as terms; out of reach: 9 bits lose more than that.",
        "",
        "![Error against terms kept](../wavelet4d_errors.png)",
        "",
        f"| transform | {' | '.join(f'{error:.0%}' for error in ERRORS)} |",
        "|---" * (1 + len(ERRORS)) + "|",
    ]
    for line, _ in LINES:
        mine = {row["wanted"]: row["terms"] for row in rows if row["line"] == line}
        cells = [f"{mine[error]:.2f}" if error in mine else "out of reach" for error in ERRORS]
        lines.append(f"| {line} | {' | '.join(cells)} |")
    return lines


def terms():
    """Figure 9."""
    forms = Forms(*SUBJECT)
    models = {name: forms.fitted(error=0.02, mode=mode)
              for name, mode in (("adaptive 4D", "adaptive"), ("2D", "2d"))}  # fmt: skip
    lights = turning_courtyard(forms.bake.cube_map)
    rows = []
    for count in N_WAVELETS:
        spent = {name: [] for name in models}
        rates = {name: [] for name in models}
        for light in [lights[0], *lights]:
            for name, model in models.items():
                model.set_params(n_terms=count, light_error=0.0)
                spent[name].append(processor_seconds(model, light))
                rates[name].append(entries_a_term(model, light))
        for name in models:
            seconds = np.median(spent[name][1:])
            rows.append(
                {
                    "subject": forms.name,
                    "line": name,
                    "wavelets": count,
                    "rate": float(np.mean(rates[name])),
                    "frames": float(1 / seconds),
                }
            )
            print(rows[-1], flush=True)
    labels = {
        "wavelets": "wavelets of the light",
        "rate": "entries a term in the columns used",
        "frames": "frames a second of one core",
    }
    picture = [curve_plot(rows, "wavelets", y, "subject", "line", labels) for y in labels][1:]
    (PICTURES / "wavelet4d_rate.png").write_bytes(picture[0])
    (PICTURES / "wavelet4d_frames.png").write_bytes(picture[1])
    lines = [
        f"After figure 9 (`wavelet4d_figures.py terms`): {forms.name} at 2 %, the light cut to so "
        f"many wavelets, {len(lights)} frames of a turning courtyard, by turns. Rate: entries of "
        "the columns that a frame uses, for each term in them. Frames for each second of one "
        "core's time, which other work on the machine hardly changes.",
        "",
        "![Entries a term by wavelets of the light](../wavelet4d_rate.png)",
        "![Frames a second by wavelets of the light](../wavelet4d_frames.png)",
        "",
        "| wavelets | rate: adaptive, 2D | frames a second of one core: adaptive, 2D | ratio |",
        "|---" * 4 + "|",
    ]
    for deep, flat in zip(rows[::2], rows[1::2], strict=True):
        lines.append(
            f"| {deep['wavelets']:,} | {deep['rate']:,.0f}, {flat['rate']:.1f} "
            f"| {deep['frames']:.1f}, {flat['frames']:.1f} "
            f"| {deep['frames'] / flat['frames']:.2f} |"
        )
    return lines


def processor_seconds(model, light):
    """Of a frame, all cores together: what else the machine does hardly tells on it."""
    start = time.process_time()
    model.product(light)
    return time.process_time() - start


def terms_read(model, light):
    """Terms in the columns of the wavelets that a light is cut to, and how many wavelets."""
    used = model.choose(light).any(axis=1)
    return int(model.counts_.reshape(-1, len(used))[:, used].sum()), int(used.sum())


def entries_a_term(model, light):
    read, wavelets = terms_read(model, light)
    return wavelets * model.n_points_ * model.n_outputs_ / max(read, 1)


def mesh():
    """Figure 10."""
    name = "bunny"
    forms = Forms(name, "model256", wavelet="9/7")
    bake, image = forms.bake, forms.bake.scene.image
    model = forms.fitted(error=0.02, mode="adaptive").set_params(
        n_terms=GEOMETRY_TERMS, light_error=0.0
    )
    light = next(studio_lights(bake))
    exact = bake.transport.radiance(light)
    whole = bake.image(exact)
    # The albedo is part of a pixel's row.
    relit = model.product(light).reshape(image.height, image.width, 3)
    point, u, v = vertex_texels(bake, model_mesh(name))
    on_mesh = exact.copy()
    on_mesh[point] = read_texels(relit, u, v)
    caster = bake.make_caster("embree")
    rays = CameraRays(bake.scene, caster, bake.camera, 480, 480)
    caster.close()
    pictures = [relit, whole, rays.picture(on_mesh), rays.picture(exact)]
    stops = -np.log2(np.percentile(whole.max(axis=-1), 97))
    shown = [to_srgb(picture, stops) for picture in pictures]
    shown[:2] = [enlarged(picture, 480) for picture in shown[:2]]
    labels = [f"Geometry image, {GEOMETRY_TERMS} wavelets of the light", "The same, exact",
              "Read from it at the model's vertices", "The vertices' own, exact"]  # fmt: skip
    write_png(PICTURES / "wavelet4d_mesh.png", contact_sheet(shown, labels, 2))
    far = {
        "image": np.linalg.norm(relit - whole) / np.linalg.norm(whole),
        "vertices": np.linalg.norm(on_mesh[point] - exact[point]) / np.linalg.norm(exact[point]),
    }
    full = 4 * image.height * image.width * forms.rows.n_directions * forms.rows.n_outputs
    return [
        f"After figure 10 (`wavelet4d_figures.py mesh`): the geometry image of the {name}, "
        f"{image.width} x {image.height} texels over the sphere at 6 x 32 x 32 directions, in "
        f"{model.nbytes / 1e6:.1f} MB ({model.nbytes / full:.2%} of the matrix as floats; "
        f"published: 5.5 %), relit with {GEOMETRY_TERMS} wavelets of city and put on the "
        f"mesh. Relit texels are {far['image']:.2%} from the exact ones, colours read from them at "
        f"the vertices {far['vertices']:.2%} from their own (relative L2).",
        "",
        "![Geometry image and mesh, relit and exact](../wavelet4d_mesh.png)",
    ]


def enlarged(picture, size):
    """Nearest texels of a (n, n, 3) picture."""
    place = np.arange(size) * len(picture) // size
    return picture[place][:, place]


def frames():
    """Paired frames of adaptive 4D and of 2D wavelets at equal error, each light by turns."""
    kept = CACHE / "frames.json"
    rows = json.loads(kept.read_text()) if kept.exists() else {}
    for name, kind in PAIRS:
        forms = Forms(name, kind)
        lights = turning_courtyard(forms.bake.cube_map)
        for error in PAIR_ERRORS:
            key = f"{forms.name} {error}"
            if key in rows:
                continue
            pair = [forms.fitted(error=error, mode=mode) for mode in ("adaptive", "2d")]
            seconds = []
            for light in [lights[0], *lights * REPEATS]:
                seconds.append([processor_seconds(model, light) for model in pair])
            deep, flat = np.transpose(seconds[1:])
            reads = [[terms_read(model, light)[0] for light in lights] for model in pair]
            rows[key] = {
                "points": forms.rows.n_points,
                "bytes": [model.nbytes for model in pair],
                "read": [float(np.mean(read)) for read in reads],
                "ms": [1e3 * float(np.median(part)) for part in (deep, flat)],
                "ratio": float(np.median(flat / deep)),
            }
            print(key, rows[key], flush=True)
            kept.write_text(json.dumps(rows))
    return frames_table(rows)


def frames_table(rows):
    """Lines of what `frames` keeps."""
    lines = [
        "Adaptive 4D against 2D at equal error, the light cut as by default (`wavelet4d_figures.py "
        f"frames`): bytes, terms that a frame reads, milliseconds of one core. "
        f"{N_PAIRS} pairs of frames by turns: the ratio is the median of those of "
        "the pairs.",
        "",
        "| subject | points | error | MB: adaptive, 2D | ratio | million terms read | ratio "
        "| ms | ratio |",
        "|---" * 9 + "|",
    ]
    for key, row in rows.items():
        named, error = key.rsplit(" ", 1)
        mb, read = np.array(row["bytes"]) / 1e6, np.array(row["read"]) / 1e6
        lines.append(
            f"| {named} | {row['points']:,} | {float(error):.0%} | {mb[0]:.2f}, {mb[1]:.2f} "
            f"| {mb[1] / mb[0]:.2f} | {read[0]:.2f}, {read[1]:.2f} | {read[1] / read[0]:.2f} "
            f"| {row['ms'][0]:.0f}, {row['ms'][1]:.0f} | {row['ratio']:.2f} |"
        )
    return lines


PARTS = {
    "errors": ("Error against terms kept", errors),
    "terms": ("Frames by wavelets of the light", terms),
    "mesh": ("A geometry image on its mesh", mesh),
    "frames": ("4D frames against 2D", frames),
}
SECTIONS = {title: lambda m=measure: m() if data_folder() else [] for title, measure in
            PARTS.values()}  # fmt: skip

if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1] not in PARTS:
        sys.exit(__doc__)
    write_sections(PAGE, dict([PARTS[sys.argv[1]]]))
