"""docs/benchmarks/sampling.md, a part at a time.

python tests/benchmarks/sampling.py objects [SCENE ...]   entries and errors against every entry
python tests/benchmarks/sampling.py curve [SCENE ...]     errors against entries, with the rivals
python tests/benchmarks/sampling.py time [BACK_END ...]   seconds against every entry traced
python tests/benchmarks/sampling.py growth                rays and seconds against points
python tests/benchmarks/sampling.py hard                  leaves, bench, thin sheets, a hard sun
python tests/benchmarks/sampling.py coverage [SCENE METHOD]   the certificate's interval, 200 seeds
python tests/benchmarks/sampling.py tables [COMMAND]      what the other benchmarks print

Scenes are those of `prt_core.blender.measuring`. Each part adds its rows to
build/bench/sampling.json and writes its section of the page anew; `make bench` runs all of them.
"""

import json
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
from scipy.stats import binom

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from prt_core import BakeSettings, bake_steps, run  # noqa: E402
from prt_core.blender.measuring import GROUND, MODELS, data_folder, measuring_scene  # noqa: E402
from prt_core.evaluate.bench.sampling import (  # noqa: E402
    bench_sampling_steps,
    matrix_errors,
    parse_method,
)
from prt_core.evaluate.bench.sampling_report import error_plot  # noqa: E402
from prt_core.light import EnvironmentMap  # noqa: E402
from prt_core.sampling import sampler_named  # noqa: E402
from prt_core.sampling.tracer import count_bits  # noqa: E402
from prt_core.sphere import CubeMap  # noqa: E402
from tests.benchmarks.certificate_coverage import coverage, scene_named  # noqa: E402
from tests.benchmarks.exhaustive import exhaustive_bits  # noqa: E402
from tests.benchmarks.sections import write_sections  # noqa: E402

KEPT = ROOT / "build" / "bench" / "sampling.json"
CUBE = CubeMap(32)
CAREFUL = "agreement:neighbours=4,checks=4,edge_halvings=2,looks=2,look_share=1"
THOROUGH = "agreement:neighbours=4,checks=4,edge_halvings=2,looks=4,look_reach=3,look_share=1"
METHODS = ("agreement", CAREFUL, "huang")
CURVE = ("agreement:neighbours=2,looks=0", "agreement",
         "agreement:neighbours=4,checks=4,edge_halvings=3,look_share=1", CAREFUL,
         "agreement:neighbours=4,checks=4,edge_halvings=2,looks=3,look_reach=2,look_share=1",
         THOROUGH, "huang:features=60", "huang", "huang:features=700", "huang:columns=hasan",
         "huang:columns=wang")  # fmt: skip
# Errors (per cent) of Huang & Ramamoorthi (2010), figures 9 and 10, at about 12 % of the entries.
PAPER = {("dancer", "model"): 7.43, ("dancer", "ground"): 1.72,
         ("bunny", "model"): 2.86, ("bunny", "ground"): 0.79}  # fmt: skip
# (Subdivisions of Suzanne, vertices along an edge of the ground): 15, 60 and 240 k points.
SIZES = ((2, 86), (3, GROUND), (4, 341))
HARD = ("04_sheets_and_leaves", "05_street_bench", "07_hard_cases")
N_SEEDS = 200
TABLES = ("l1_solvers.py", "huang_tables.py radius dancer", "huang_tables.py rivals dancer",
          "huang_tables.py indirect")  # fmt: skip
PAGE = "sampling"


def objects(names):
    """Entries traced and errors of samplers, object by object."""
    for name in names or available():
        scene = measuring_scene(name)
        truth = exhaustive_bits(name, scene, CUBE)
        caster = scene.make_caster("embree")
        for text in METHODS:
            method = parse_method(text)
            sampler = sampler_named(method.name)[0]
            result = run(sampler(scene, CUBE, caster, method.made_settings(0)))
            errors, sizes = matrix_errors(scene, CUBE, result.bits, truth)
            for index, item in enumerate(scene.objects):
                mine = scene.points.object_index == index
                yield (
                    f"{name} {text} {item.name}",
                    {
                        "entries": _entries(result.traced[mine]),
                        "error": _relative(errors[mine], sizes[mine]),
                    },
                )
        caster.close()


def curve(names):
    """Errors at many settings of all samplers."""
    for name in names or available():
        scene = measuring_scene(name)
        caster = scene.make_caster("embree")
        methods = [parse_method(text) for text in CURVE]
        rows, _ = run(bench_sampling_steps(scene, CUBE, caster, methods, {}, name))
        caster.close()
        for row in rows:
            yield f"{name} {row['label']} {row['object']}", {**row, "scene": name}


def available():
    """Measuring scenes whose meshes are here."""
    return [name for name, file in MODELS.items() if file is None or data_folder()]


def _entries(traced):
    return 100 * int(count_bits(traced)) / (len(traced) * CUBE.n_directions)


def _relative(errors, sizes):
    return 100 * float(np.sqrt(errors.sum() / max(sizes.sum(), 1e-300)))


def time_(back_ends):
    """Seconds of both ways to sample and of every entry traced, in one run."""
    for back_end in back_ends or ("embree", "blender"):
        if back_end == "blender":
            import bpy  # noqa: F401

            import prt_core.blender  # noqa: F401
        scene = measuring_scene("suzanne")
        caster = scene.make_caster(back_end)
        methods = [parse_method("agreement"), parse_method("huang")]
        rows, results = run(bench_sampling_steps(scene, CUBE, caster, methods, {}, "suzanne"))
        caster.close()
        ours, whole = results["agreement"], results["exhaustive"]
        yield back_end, {
            "whole": whole.seconds["total"], "whole_rays": int(whole.rays), "rays": int(ours.rays),
            "seconds": ours.seconds,
            "sparse": results["huang"].seconds["total"], "sparse_rays": int(results["huang"].rays),
            **{row["method"]: row["time_ratio"] for row in rows},
        }  # fmt: skip


def growth(_):
    """Rays and seconds of the same scene, ever finer."""
    for levels, ground in SIZES:
        scene = measuring_scene("suzanne", ground, levels)
        caster = scene.make_caster("embree")
        caster.occluded(scene.ray_origins[:1], CUBE.samples[:1].astype(np.float32))
        start = time.perf_counter()
        result = run(sampler_named("agreement")[0](scene, CUBE, caster))
        yield str(ground), {
            "points": len(scene.points), "rays": int(result.rays),
            "seconds": time.perf_counter() - start,
        }  # fmt: skip
        caster.close()


def hard(_):
    """Scenes that are not kind to sampling, baked with what `prt bake` takes."""
    skies = {"": None}
    if data_folder():
        image = EnvironmentMap.read(data_folder() / "probes" / "openexr_KernerEnvLatLong.exr")
        skies["under a hard sun"] = {"sun": image.to_cube_map(CUBE, 0)}
    for name in HARD:
        scene = scene_named(name)
        for light, lights in skies.items():
            with tempfile.TemporaryDirectory() as folder:
                settings = BakeSettings(caster="embree", bounces=0, method="agreement")
                report = run(bake_steps(scene, Path(folder) / "a.prt", settings, lights=lights))
            yield f"{name} {light}".strip(), {
                "points": len(scene.points), "entries": report["entries_percent"],
                "error": 100 * report["visibility_error"], "met": report["tolerance_met"],
                "turns": report["sampling"]["turns"],
            }  # fmt: skip


def coverage_(names):
    """How often the certificate's interval holds the truth."""
    pairs = [names] if names else [(s, m) for s in ("balls", "04", "05")
                                   for m in ("agreement", "huang")]  # fmt: skip
    for name, method in pairs:
        rows = coverage(scene_named(name), method, CubeMap(16), N_SEEDS)
        for row in rows:
            yield f"{name} {method} {row['object']} {row['what']}", row


def tables(commands):
    """What the benchmarks of the sparse method and of its solver print."""
    for command in commands:
        script, *arguments = command.split()
        done = subprocess.run(
            [sys.executable, Path(__file__).with_name(script), *arguments],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        shown = [line for line in done.stdout.splitlines() if "import of" not in line]
        yield command, shown


def _objects(rows):
    yield from (
        "Per cent of all n x 6,144 entries of the object that were traced, and the relative L2 "
        f"error of its matrix in per cent. Careful: `{CAREFUL}`. Sparse: `huang`, rebuilt after "
        "Huang and Ramamoorthi (2010) with a quarter of the points dense, 350 features and L1; "
        "published: their own figures.",
        "", "| scene | object | default: entries, error | careful: entries, error "
        "| sparse: entries, error | published error |", "|---|---|---|---|---|---|",
    )  # fmt: skip
    for name in MODELS:
        for item in ("model", "ground"):
            keys = [f"{name} {method} {item}" for method in METHODS]
            if all(key in rows for key in keys):
                cells = [f"{rows[k]['entries']:.2f}, **{rows[k]['error']:.2f}**" for k in keys]
                paper = PAPER.get((name, item), "")
                yield f"| {name} | {item} | {' | '.join(cells)} | {paper} |"


def _curve(rows):
    rows = [row for row in rows.values() if row["method"] != "exhaustive"]
    names = [name for name in MODELS if any(row["scene"] == name for row in rows)]
    result = {}
    for name in names:
        mine = [row for row in rows if row["scene"] == name]
        picture = ROOT / "docs" / f"sampling_{name}.png"
        picture.write_bytes(error_plot(mine, ["entries_percent"]))
        for row in mine:
            value = f"{row['entries_percent']:.2f}, {100 * row['matrix_l2']:.2f}"
            result[row["label"], name, row["object"]] = value
    columns = [(name, item) for name in names for item in ("model", "ground")]
    yield from (
        "Entries and errors in per cent; `hasan` and `wang` are the sparse method with the columns "
        "of Hasan et al. (2007) and Wang et al. (2009) (`sampling.py curve`).",
        "", *(f"![{name}: errors against entries](../sampling_{name}.png)" for name in names),
        "", f"| method | {' | '.join(' '.join(column) for column in columns)} |",
        "|---" * (1 + len(columns)) + "|",
    )  # fmt: skip
    for label in dict.fromkeys(label for label, *_ in result):
        cells = [result.get((label, *column), "") for column in columns]
        yield f"| {label} | {' | '.join(cells)} |"


def _times(rows):
    yield from (
        "Suzanne on the ground, 60,899 points: sampling by agreement, and the sparse method, "
        "against every entry traced, without the bounces, in one run (`sampling.py time`).",
        "", "| back-end | every entry s | rays | agreement s | rays | ratio | of it rays s "
        "| arithmetic s | neighbours s | horizons s | sparse s | rays | ratio |",
        "|---" * 13 + "|",
    )  # fmt: skip
    for back_end, row in rows.items():
        spent = row["seconds"]
        rays = f"{row['rays'] / 1e6:.1f} M"
        stages = " | ".join(
            f"{spent[s]:.2f}" for s in ("rays", "agreement", "neighbours", "horizon")
        )
        yield (
            f"| {back_end} | {row['whole']:.1f} | {row['whole_rays'] / 1e6:.0f} M | "
            f"{spent['total']:.1f} | {rays} | **{row['agreement']:.3f}** | {stages} | "
            f"{row['sparse']:.1f} | {row['sparse_rays'] / 1e6:.1f} M | {row['huang']:.3f} |"
        )


def _growth(rows):
    rows = sorted(rows.values(), key=lambda row: row["points"])
    logs = {key: np.log([row[key] for row in rows]) for key in ("points", "rays", "seconds")}
    slopes = {k: np.polyfit(logs["points"], logs[k], 1)[0] for k in ("rays", "seconds")}
    yield from (
        "The same scene ever finer (`sampling.py growth`). Rays grow with the power "
        f"**{slopes['rays']:.2f}** of the points, seconds with {slopes['seconds']:.2f}.",
        "", "| points | rays | rays a point | seconds |", "|---|---|---|---|",
    )  # fmt: skip
    for row in rows:
        each = row["rays"] / row["points"]
        yield (
            f"| {row['points']:,} | {row['rays'] / 1e6:.2f} M | {each:.0f} | {row['seconds']:.1f} |"
        )


def _hard(rows):
    yield from (
        "As `prt bake --method agreement` bakes them: tolerance 1 % of the light that every object "
        "receives; under probe lights, and under a photographed sky with a hard sun "
        "(`sampling.py hard`). Turns: how often what missed the tolerance was asked again.",
        "", "| scene | points | entries % | certified error % | tolerance met | turns |",
        "|---|---|---|---|---|---|",
    )  # fmt: skip
    for name, row in rows.items():
        yield (
            f"| {name} | {row['points']:,} | {row['entries']:.2f} | {row['error']:.2f} | "
            f"{'yes' if row['met'] else 'no'} | {row['turns']} |"
        )


def _coverage(rows):
    # Nothing is certified where nothing is wrong.
    rows = {key: row for key, row in rows.items() if row["true"] > 0}
    by_chance = binom.cdf(183, 200, 0.95) + binom.sf(196, 200, 0.95)
    yield from (
        f"How often of {N_SEEDS} seeds the 95 % interval holds the true error, 6 x 16 x 16 "
        "directions (`sampling.py coverage`): the least, the mean and the most over objects, for "
        "relit colours over objects and lights. How many of these lie outside 92 to 98 %: of "
        f"perfect intervals {by_chance:.1%} would, by chance. Narrow: of those above 98 %, the "
        "intervals less than 3 % wide, where all rows that count are found almost surely. "
        "Understated: how often the truth lies above the interval, in the mean.", "",
        "| scene | method | error of | intervals | held %: least, mean, most "
        "| below 92 % | above 98 % (narrow) | understated % | mean width % of the truth "
        "| true errors % |",
        "|---" * 10 + "|",
    )  # fmt: skip
    for name, method in sorted({tuple(key.split()[:2]) for key in rows}):
        mine = [row for key, row in rows.items() if key.startswith(f"{name} {method} ")]
        for what in ("matrix", "relit colours"):
            subset = [row for row in mine if (row["what"] == "matrix") == (what == "matrix")]
            keys = ("held", "understated", "true", "mean_low", "mean_high")
            held, under, true, low, high = np.transpose(
                [[row[key] for key in keys] for row in subset]
            )
            held, under = (100 * count / subset[0]["seeds"] for count in (held, under))
            wide = (high - low) / true
            narrow = int(((held > 98) & (wide < 0.03)).sum())
            yield (
                f"| {name} | {method} | {what} | {len(subset)} "
                f"| {held.min():.1f}, {held.mean():.1f}, {held.max():.1f} | {(held < 92).sum()} "
                f"| {(held > 98).sum()} ({narrow}) | {under.mean():.1f} | {100 * wide.mean():.0f} "
                f"| {100 * true.min():.2f} to {100 * true.max():.2f} |"
            )


# {part: (title of its section, what measures its rows, what shows them)}
PARTS = {
    "objects": ("Entries and errors", objects, _objects),
    "curve": ("Against the rivals", curve, _curve),
    "time": ("Seconds", time_, _times),
    "growth": ("Growth", growth, _growth),
    "hard": ("Hard scenes", hard, _hard),
    "coverage": ("The certificate", coverage_, _coverage),
}


def sections(part, names=()):
    """{title: what measures it} of a part."""
    if part == "tables":
        return {f"`{command}`": partial(_printed, command) for command in names or TABLES}
    return {PARTS[part][0]: partial(_shown, part, names)}


def _shown(part, names):
    _, measure, show = PARTS[part]
    return list(show(keep(part, measure(list(names)))))


def _printed(command):
    return ["```", *keep("tables", tables([command]))[command], "```"]


SECTIONS = {
    title: measure for part in [*PARTS, "tables"] for title, measure in sections(part).items()
}


def keep(part, rows):
    """All rows of a part; each new one is kept as soon as it is there."""
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    for key, row in rows:
        kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
        kept.setdefault(part, {})[key] = row
        KEPT.write_text(json.dumps(kept, indent=1))
        print(key, json.dumps(row), flush=True)
    return kept[part]


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in [*PARTS, "tables"]:
        sys.exit(__doc__)
    write_sections(PAGE, sections(sys.argv[1], sys.argv[2:]))
