"""docs/benchmarks/gloss.md: forms of view-dependent transport, speed against error.

    python tests/benchmarks/results.py --only gloss

Scene 02: Suzanne on the ground, a few thousand points, every entry of the visibility traced.
"""

import contextlib
import io
import json
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build" / "bench"
PAGE, PLOT = "gloss", "gloss_speed_error.png"
SCENE = "02_model_on_ground_small"
# Rivals' tables and terms are of some minutes: three of Blender's images as they are.
BENCH = ("--rotate", "0", "--sample", "500")
# Of the paper's comparison: relit error, and time of sampling in parts of that of every entry.
MOST_ERROR, MOST_TIME = 0.01, 0.2


def baked():
    """The bake of the scene; made where it is missing."""
    path = WORK / "gloss.prt"
    if not path.exists():
        WORK.mkdir(parents=True, exist_ok=True)
        command("bake", ROOT / "blend_scenes" / f"{SCENE}.blend", "-o", path, "--bounces", "0",
                "--method", "exhaustive")  # fmt: skip
    return path


def command(*words):
    """JSON of a `prt` command in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "prt_core", *map(str, words), "--json"],
        capture_output=True, text=True, cwd=ROOT, check=True,
    )  # fmt: skip
    return json.loads(done.stdout)


def speed_and_error():
    """Every form, at three roughnesses and Phong 10."""
    folder = WORK / "gloss"
    rows = command("bench", "gloss", baked(), "-o", folder, *BENCH)
    shutil.copy(folder / "speed_error.png", ROOT / "docs" / PLOT)
    return speed_lines(rows)


def speed_lines(rows):
    """Markdown of the rows of `prt bench gloss`."""
    from prt_core.evaluate.bench.gloss import nearer_and_quicker

    lines = [
        f"`prt bench gloss {SCENE}.prt -o FOLDER {' '.join(BENCH)}`, baked with `--bounces 0 "
        f"--method exhaustive`: {max(row['points'] for row in rows):,} points, "
        f"{max(row['facing'] for row in rows):,} of them seen. All times are of the processor, "
        "both cores together: microseconds for each seen point of a view, milliseconds of a light, "
        "for all points, seconds of what is prepared once. Errors are relative L2 "
        "against the dense sum at some 500 seen points, mean and worst over three of Blender's "
        "images. 'Texels apart' are the brightest of the light, summed from their own bits; the "
        "default does that by itself. The factor for shadows of reflection maps is exact, and as "
        "dear as the dense sum: its time is not in the table.",
        "",
        f"![speed against error](../{PLOT})",
    ]
    for name in dict.fromkeys(row["reflectance"] for row in rows):
        lines += [
            "",
            f"### {name}",
            "| form | view us | light ms | prepared s | MB | mean | worst |",
            "|---|---|---|---|---|---|---|",
        ]
        mine = [row for row in rows if row["reflectance"] == name]
        for row in sorted(mine, key=lambda row: row["l2_mean"]):
            lines.append(
                f"| {row['form']} | {row['view_us']:.2f} | {row['light_ms']:.0f} | "
                f"{row['seconds']:.1f} | {row['megabytes']:.1f} | {row['l2_mean']:.2%} | "
                f"{row['l2_worst']:.2%} |"
            )
        warnings = dict.fromkeys(row["warning"] for row in mine if row["warning"])
        lines += [f"\nIn-out terms are warned of: {warning}." for warning in warnings]
    others = [row for row, _ in nearer_and_quicker(rows) if row["method"] != "dense"]
    said = "; ".join(f"{row['reflectance']}: {row['form']}" for row in others)
    lines += ["", f"Quicker in a view than the default and nearer as well: {said or 'none'}."]
    return lines


def sampled_terms():
    """Four terms of Phong 10, half diffuse, each sampled as the paper does, and all together."""
    from prt_core import load
    from prt_core.cli.bench_scenes import images_or_skies, turned
    from prt_core.evaluate.bench.term_sampling import term_sampling_steps
    from prt_core.reflectance import Lambert, Phong, Sum, in_out_factors
    from prt_core.runtime.progress import run
    from prt_core.scene import auto_camera
    from prt_core.transport import View

    bake = load(baked())
    lights = turned(images_or_skies(None), [0.0], bake.cube_map)
    factors = in_out_factors(Sum([Lambert(0.5), Phong(10, 0.5)]), 4)
    view = View.of_camera(bake.camera or auto_camera(bake.scene))
    outgoing = view.outgoing(bake.scene.to_world(bake.scene.points.positions))
    caster = bake.make_caster()
    with contextlib.redirect_stderr(io.StringIO()):
        steps = term_sampling_steps(bake.scene, bake.cube_map, caster, factors, lights, outgoing)
        rows, together, errors = run(steps)
    caster.close()
    return sampled_lines(rows, together, errors)


def sampled_lines(rows, together, errors):
    """Markdown of what `term_sampling_steps` returns."""
    by_term = {row["term"]: row for row in rows}
    sparse = sum(row["seconds"] for row in by_term.values())
    whole = sum(row["whole_seconds"] for row in by_term.values())
    worst = [max(error[i] for error in errors.values()) for i in (0, 1)]
    lines = [
        "Figure 20 of Huang and Ramamoorthi 2010: four in-out terms of Phong 10, half diffuse, on "
        f"{SCENE}, `huang` on the rows of each (F_k times visibility), Embree, seconds of the "
        "processor. Per cent: of points that are dense, of the directions traced there, and "
        "of all entries of the object. The paper has 11.1 to 11.4 % in all, 0.2 of the time.",
        "",
        "| term | object | points | dense points % | angular % | dense % | sparse % | total % "
        "| sparsely s | fully s |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row['term'] + 1} | {row['object']} | {row['points']:,} | "
            f"{row['dense_points']:.1f} | {row['dense_angular']:.1f} | {row['dense']:.2f} | "
            f"{row['sparse']:.2f} | {row['entries']:.2f} | {row['seconds']:.1f} | "
            f"{row['whole_seconds']:.1f} |"
        )
    lines += [
        "",
        f"Relit colours against the same four terms with every entry traced (floors: "
        f"{MOST_ERROR:.0%}, and {MOST_TIME:g} of the time of tracing every entry once a term):",
        "",
        f"| sampled | {' | '.join(errors)} | seconds | of the time |",
        "|---" * (len(errors) + 3) + "|",
    ]
    pairs = (("each term by `huang`", sparse), ("all at once by `agreement`, "
             f"{together['entries']:.1f} % of the entries", together["seconds"]))  # fmt: skip
    for index, (label, seconds) in enumerate(pairs):
        cells = " | ".join(f"{error[index]:.2%}" for error in errors.values())
        met = worst[index] <= MOST_ERROR, seconds <= MOST_TIME * whole
        said = " and ".join("met" if each else "**missed**" for each in met)
        lines.append(f"| {label} | {cells} | {seconds:.1f} | {seconds / whole:.2f} ({said}) |")
    lines += [
        "",
        "Visibility is all that has to be sampled, and it is the same for every term: one run of "
        "sampling by agreement serves them all. With an Embree ray as cheap as it is, factors "
        "and solutions of the sparse points of each term take longer than to trace every entry.",
    ]
    return lines


def views_and_lights():
    """Views that are evaluated and looked up, and what a light takes, bounces and all."""
    from tests.benchmarks.gloss_views import section

    return section()


def bakes():
    """What gloss adds to a bake."""
    from tests.benchmarks.gloss_bakes import section

    return section()


SECTIONS = {
    "Speed and error": speed_and_error,
    "Views that are looked up": views_and_lights,
    "Bakes": bakes,
    "Terms sampled sparsely": sampled_terms,
}
