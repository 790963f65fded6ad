"""Wavelets of the rows with wavelets of the columns: section 5.2 of Cheslack-Postava et al. (2007).

python tests/benchmarks/wavelet4d_filters.py SCENE KIND N [ERROR]   into docs/benchmarks
python tests/benchmarks/wavelet4d_filters.py      what is kept, into docs/benchmarks

They found Daubechies 4 for the rows and LeGall 5/3 for the columns best. SCENE, KIND and N as
`wavelet4d_tables.py image` takes them; what was measured before stays in the table.
"""

import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from prt_core.basis import ORTHONORMAL, WAVELETS, ImageWavelet  # noqa: E402
from prt_core.blender.measuring import data_folder  # noqa: E402
from prt_core.compress import Wavelet4D  # noqa: E402
from prt_core.runtime.progress import run  # noqa: E402
from tests.benchmarks.sections import write_sections  # noqa: E402
from tests.benchmarks.wavelet4d_tables import CACHE, image_bake, image_path, image_rows  # noqa: E402

PAGE = "wavelets"
TITLE = "Row filters with column filters"


def measure(name, kind, size, error=0.02):
    """Bytes of every pair of filters, kept as soon as they are known."""
    path = image_path(name, kind, size)
    bake = image_bake(name, kind, size)
    shown, rows = bake.scene.image, image_rows(bake)
    shape = shown.height, shown.width
    kept = path.with_suffix(".filters.json")
    sizes = json.loads(kept.read_text()) if kept.exists() else {}
    for row_filter in ORTHONORMAL:
        first = Wavelet4D(ImageWavelet(shape), rows=row_filter)
        with run(first.columns_steps(rows)) as file:
            for column_filter in WAVELETS:
                key = f"{error} {row_filter} {column_filter}"
                if key in sizes:
                    continue
                columns = ImageWavelet(shape, column_filter)
                model = Wavelet4D(columns, rows=row_filter, error=float(error))
                run(model.fit_columns_steps(rows, file))
                sizes[key] = model.nbytes
                print(path.stem, key, model.nbytes, f"{model.matrix_error_:.4%}", flush=True)
                kept.write_text(json.dumps(sizes))
    return filters_table()


def filters_table():
    """Lines of all that is kept."""
    lines = []
    for path in sorted(CACHE.glob("*.filters.json")):
        sizes = json.loads(path.read_text())
        for error in dict.fromkeys(key.split()[0] for key in sizes):
            for row_filter in ORTHONORMAL:
                mine = [sizes.get(f"{error} {row_filter} {column}") for column in WAVELETS]
                if not any(mine):
                    continue
                cells = ["" if size is None else f"{size / 1e6:.2f}" for size in mine]
                named = path.name.removesuffix(".filters.json")
                lines.append(
                    f"| {named} | {float(error):.0%} | {row_filter} | {' | '.join(cells)} |"
                )
    return lines and [
        "MB of adaptive 4D wavelets at an equal relative L2 of the matrix, for each filter of the "
        "rows (first) and of the columns (`wavelet4d_filters.py`). Published: D4 rows with 5/3 "
        "columns are best.",
        "",
        f"| image | error | rows | {' | '.join(WAVELETS)} |",
        "|---" * (3 + len(WAVELETS)) + "|",
        *lines,
    ]


SECTIONS = {TITLE: lambda: measure("bunny", "ground", 256) if data_folder() else []}

if __name__ == "__main__":
    write_sections(
        PAGE, {TITLE: lambda: measure(*sys.argv[1:]) if sys.argv[1:] else filters_table()}
    )
