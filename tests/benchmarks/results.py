"""`make bench`: measure and write the pages of docs/benchmarks with their pictures.

python tests/benchmarks/results.py [--truth FOLDER] [--only PART ...]

Each part (rays, bake, large, sampling, compression, irradiance, clusters, wavelets, filters,
figures, truth, assets, lightfield, gloss, refinement, moved, costs) replaces its own sections.

Cycles' bakes are kept in the truth folder (default build/truth) and made where they are missing:
the first run takes hours.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "blend_scenes")]

import build  # noqa: E402
import prt_core  # noqa: E402
import prt_core.blender  # noqa: E402, F401
from prt_core.blender.colours import corners_to_vertices  # noqa: E402
from prt_core.evaluate import colour_error, contact_sheet, to_srgb, write_png  # noqa: E402
from prt_core.evaluate.view import CameraRays  # noqa: E402
from tests.benchmarks import (  # noqa: E402
    assets,
    compress_tables,
    farm_tiles,
    farm_workers,
    gloss_page,
    irradiance,
    lightfield_page,
    moved,
    object_clusters,
    refinement,
    sampling,
    wavelet4d_figures,
    wavelet4d_filters,
    wavelet4d_tables,
)
from tests.benchmarks.sections import write_sections  # noqa: E402

WORK = ROOT / "build" / "bench"
MODEL = ROOT / "blend_scenes" / "01_model_on_ground.blend"
LIGHTS = ("courtyard", "city", "sunset")
TRUTH, NOISY = 2048, 256
# Resolution of the cube map, and whether the image's sun gets shadow rays (--sharp-sun).
VARIANTS = ((32, False), (64, False), (32, True))


def prt(*arguments):
    """Run the command line in a process of its own; its JSON and the seconds it took."""
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "prt_core", *map(str, arguments), "--json"],
        capture_output=True, text=True, cwd=ROOT, check=True,
    )  # fmt: skip
    return json.loads(done.stdout), time.perf_counter() - start


def rays_table():
    rows, _ = prt("bench", "rays", MODEL)
    lines = [
        "`prt bench rays blend_scenes/01_model_on_ground.blend`: "
        f"{rows['points']:,} points, {rows['rays']:,} rays of the visibility stage.",
        "",
        "| back-end | stage M/s | bare caster M/s | stage / bare | incoherent M/s | disagree |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows["back_ends"]:
        lines.append(
            f"| {row['back_end']} | {row['stage_rays_per_second'] / 1e6:.2f} | "
            f"{row['bare_rays_per_second'] / 1e6:.2f} | {row['overhead']:.2f} | "
            f"{row['incoherent_rays_per_second'] / 1e6:.2f} | "
            f"{row['disagree']} of {row['rays']:,} |"
        )
    return lines


def cycles_bake(scene, light, samples, bounces, truth):
    """One Cycles bake of a scene of `blend_scenes`, kept in the truth folder."""
    path = truth / f"{scene}_{light}_{samples}_{bounces}.npz"
    if not path.exists():
        truth.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name("part.npz")
        subprocess.run(
            [sys.executable, ROOT / "tests" / "benchmarks" / "cycles_truth.py",
             ROOT / "blend_scenes" / f"{scene}.blend", "--light", light, "--samples", str(samples),
             "--bounces", bounces, "--seed", "7" if samples == TRUTH else "1", "-o", temporary],
            check=True, capture_output=True,
        )  # fmt: skip
        temporary.replace(path)
    return np.load(path)


def bake_table():
    """Time, memory and size against Cycles for one light at 256 samples, in this run."""
    scene = "01_model_on_ground"
    fresh = WORK / "cycles"
    for old in fresh.glob("*.npz"):
        old.unlink()
    cycles = float(cycles_bake(scene, "courtyard", NOISY, "all", fresh)["seconds"])
    lines = [
        f"`prt bake blend_scenes/{scene}.blend --caster …` (all bounces, every light) against "
        f"Cycles baking one HDRI at {NOISY} samples: {cycles:.0f} s.",
        "",
        "| back-end | method | rays | visibility s | gather s | other s | whole command s "
        "| / Cycles | peak MB | store MB | error |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    pairs = [(c, m) for c in ("embree", "blender") for m in ("exhaustive", "auto")]
    for caster, method in pairs:
        output = WORK / f"{caster}.prt"
        report, spent = prt("bake", ROOT / "blend_scenes" / f"{scene}.blend", "-o", output,
                            "--caster", caster, "--method", method, "--restart")  # fmt: skip
        seconds = report["seconds"]
        other = spent - seconds["visibility"] - seconds["gather"]
        lines.append(
            f"| {caster} | {method} | {report['rays'] / 1e6:.0f} M | {seconds['visibility']:.1f} | "
            f"{seconds['gather']:.1f} | {other:.1f} | {spent:.1f} | {spent / cycles:.2f} | "
            f"{report['peak_bytes'] / 1e6:.0f} | {report['bytes'] / 1e6:.1f} | "
            f"{report['error']:.2%} |"
        )
    bake = prt_core.load(WORK / "embree.prt")
    light = prt_core.environment_light(bake, hdri("courtyard"))
    times = []
    for _ in range(5):
        start = time.perf_counter()
        bake.transport.radiance(light)
        times.append(time.perf_counter() - start)
    lines += ["", f"Relighting it exactly, all bounces, RGB: {np.median(times):.2f} s."]
    return lines


def large_table():
    """Peak memory of a bake of 250 k points."""
    path = WORK / "large.blend"
    build.clear()
    build.suzanne("model", build.diffuse("clay", (0.7, 0.65, 0.6)), 3, 1.6)
    build.grid("ground", 468, -2, 2, build.diffuse("floor", (0.5, 0.5, 0.5)))
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    report, spent = prt("bake", path, "-o", WORK / "large.prt", "--caster", "embree", "--restart")
    return [
        f"{report['points']:,} points at {report['directions']:,} directions with Embree: "
        f"{spent:.0f} s, peak memory {report['peak_bytes'] / 1e9:.2f} GB, "
        f"store {report['bytes'] / 1e6:.0f} MB.",
    ]


def hdri(name):
    return Path(bpy.utils.system_resource("DATAFILES")) / "studiolights" / "world" / f"{name}.exr"


def by_vertex(bake, radiance):
    colours = bake.colours(radiance)
    return {
        item.name: corners_to_vertices(colours[item.name], item.corner_vertex, item.n_vertices)
        for item in bake.scene.objects
    }


def truth_table():
    truth = TRUTHS
    lines = [
        f"Relative L2 (and relative error of the mean) to Cycles' vertex-colour bake at {TRUTH:,} "
        f"samples, per vertex and object; beside it Cycles at {NOISY} samples. Bold: ours is "
        "nearer and its mean is within 0.4 %.",
    ]
    for scene in ("01_model_on_ground", "03_coloured_walls"):
        bakes = {}
        for resolution in sorted({r for r, _ in VARIANTS}):
            output = WORK / f"{scene}_{resolution}.prt"
            prt("bake", ROOT / "blend_scenes" / f"{scene}.blend", "-o", output, "--restart",
                "--resolution", resolution)  # fmt: skip
            bakes[resolution] = prt_core.load(output)
        heads = " | ".join(f"{r} x {r}{', sharp sun' if s else ''}" for r, s in VARIANTS)
        lines += ["", f"### {scene}", f"| light | bounces | object | {heads} | Cycles {NOISY} |"]
        lines += ["|---" * (4 + len(VARIANTS)) + "|"]
        lights = LIGHTS + (("lamps",) if scene.startswith("03") else ())
        for light in lights:
            for bounces in ("direct", "all"):
                if not (truth / f"{scene}_{light}_{TRUTH}_{bounces}.npz").exists() and SKIP:
                    continue
                wanted = cycles_bake(scene, light, TRUTH, bounces, truth)
                noisy = cycles_bake(scene, light, NOISY, bounces, truth)
                lines += compared(bakes, scene, light, bounces, wanted, noisy)
    return lines


TRUTHS, SKIP = ROOT / "build" / "truth", False

# {part: (page, {title of a section: what measures it})}
PARTS = {
    "rays": ("rays", {"Back-ends": rays_table}),
    "bake": ("bake", {"The model on the ground": bake_table}),
    "large": ("bake", {"A large scene": large_table}),
    "sampling": (sampling.PAGE, sampling.SECTIONS),
    "compression": (
        compress_tables.PAGE,
        compress_tables.sections(WORK / "embree.prt", MODEL, WORK),
    ),
    "irradiance": (irradiance.PAGE, irradiance.SECTIONS),
    "clusters": (object_clusters.PAGE, object_clusters.SECTIONS),
    "wavelets": (wavelet4d_tables.PAGE, wavelet4d_tables.sections(measure=True)),
    "filters": (wavelet4d_filters.PAGE, wavelet4d_filters.SECTIONS),
    "figures": (wavelet4d_figures.PAGE, wavelet4d_figures.SECTIONS),
    "truth": ("cycles", {"Vertex colours": truth_table}),
    "assets": (assets.PAGE, assets.SECTIONS),
    "lightfield": (lightfield_page.PAGE, lightfield_page.SECTIONS),
    "gloss": (gloss_page.PAGE, gloss_page.SECTIONS),
    "refinement": (refinement.PAGE, refinement.SECTIONS),
    "moved": (moved.PAGE, moved.SECTIONS),
    "costs": (farm_tiles.PAGE, {**farm_tiles.SECTIONS, **farm_workers.SECTIONS}),
}


def compared(bakes, scene, light, bounces, wanted, noisy):
    from prt_core.api import relight_points

    result = {}
    for resolution, sharp in VARIANTS:
        lamps = light == "lamps"
        if lamps and sharp:
            result[resolution, sharp] = result[resolution, False]
            continue
        radiance = relight_points(
            bakes[resolution],
            None if lamps else hdri(light),
            sharp_sun=sharp,
            lamps=lamps,
            bounces=0 if bounces == "direct" else "baked",
        )
        result[resolution, sharp] = by_vertex(bakes[resolution], radiance)
    if bounces == "all" and light in ("courtyard", "city", "lamps"):
        first = min(bakes)
        difference_picture(bakes[first], scene, light, result[first, True], wanted, noisy)
    lines = []
    for name in next(iter(result.values())):
        other = colour_error(noisy[name], wanted[name])
        cells = []
        for colours in result.values():
            error = colour_error(colours[name], wanted[name])
            text = f"{error['l2']:.2%} ({error['mean']:+.2%})"
            better = error["l2"] < other["l2"] and abs(error["mean"]) < 4e-3
            cells.append(f"**{text}**" if better else text)
        cells.append(f"{other['l2']:.2%} ({other['mean']:+.2%})")
        lines.append(f"| {light} | {bounces} | {name} | " + " | ".join(cells) + " |")
    return lines


def difference_picture(bake, scene, light, ours, wanted, noisy):
    """Truth, and ten times the absolute differences of ours and of Cycles at fewer samples."""
    caster = bake.make_caster()
    rays = CameraRays(bake.scene, caster, bake.camera, 480, 300)
    caster.close()

    def shown(colours):
        points = np.zeros((len(bake.scene.points), 3), np.float32)
        for item in bake.scene.objects:
            used = item.corner_point >= 0
            points[item.corner_point[used]] = colours[item.name][item.corner_vertex[used]]
        return rays.picture(points)

    images = [shown({k: np.asarray(wanted[k]) for k in ours})]
    images += [shown({k: 10 * np.abs(c[k] - wanted[k]) for k in ours}) for c in (ours, noisy)]
    stops = -np.log2(max(np.percentile(images[0].max(axis=-1), 97), 1e-6))
    labels = [f"Cycles, {TRUTH} samples: {light}", "10 x |ours - truth|",
              f"10 x |Cycles at {NOISY} samples - truth|"]  # fmt: skip
    sheet = contact_sheet([to_srgb(image, stops) for image in images], labels, 3)
    write_png(ROOT / "docs" / f"difference_{scene}_{light}.png", sheet)


def main():
    global SKIP, TRUTHS
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--truth", type=Path, default=TRUTHS)
    parser.add_argument("--skip-missing", action="store_true", help="do not run Cycles for truth")
    parser.add_argument("--only", nargs="+", default=list(PARTS), choices=list(PARTS))
    options = parser.parse_args()
    SKIP, TRUTHS = options.skip_missing, options.truth
    WORK.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        write_sections(*PARTS[name])


if __name__ == "__main__":
    main()
