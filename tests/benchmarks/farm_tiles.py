"""What bakes cost as they grow: `python -m tests.benchmarks.farm_tiles [POINTS ...]`.

Sixteen balls, instances of one, over a floor, ever finer. Each bake runs in a process of its own;
seconds are those of all its cores together, memory is the most that it held at once.

    --tile N    sample in tiles of so many points, however large the scene is
    --worker    what a process holds that computes blocks of such a bake
    --out PATH  where bakes are made, and removed again
"""

import argparse
import json
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from prt_core import BakeSettings, Scene, bake_steps, run
from prt_core.bake.blocks import compute, stages
from prt_core.bake.memory import Memory
from prt_core.bake.plan import plan_steps
from prt_core.runtime.machine import peak_bytes, reset_peak
from tests.meshes import plane, sphere

# Balls along a side, and the share of the points that the floor has.
_SIDE, _FLOOR = 4, 0.3
# How large scenes are measured, and how large ones are reckoned.
POINTS = [15_000, 60_000, 250_000, 1_000_000]
FURTHER = [10_000_000, 100_000_000]
OUT = Path("build/farm_tiles.prt")
# What grows, and what it is called.
FIGURES = {
    "rays": "rays",
    "rays_visibility": "rays for visibility",
    "seconds": "seconds of the processor",
    "memory": "memory baking",
    "memory_build": "memory building",
    "bytes": "store",
}


def scene_of(n_points):
    """Balls over a floor, instances of one, of about so many points."""
    rings = int(np.sqrt(n_points * (1 - _FLOOR) / _SIDE**2 / 2))
    meshes = [plane(int(np.sqrt(n_points * _FLOOR)), -2, 2, name="floor", albedo=0.6)]
    ball = sphere(rings, 0.3, name="ball", albedo=(0.8, 0.5, 0.3))
    for number in range(_SIDE**2):
        row, column = divmod(number, _SIDE)
        place = np.array([(column - 1.5) * 0.9, (row - 1.5) * 0.9, 0.45])
        # Instances, as Blender's are: their corners are one array, their places are their own.
        own = {"vertices": ball.vertices + place, "corner_normal": ball.corner_normal.copy()}
        meshes.append(replace(ball, name=f"ball {number}", owner=f"ball {number}", **own))
    return Scene.from_meshes(meshes)


def measure(n_points, out, memory=None, tile=None):
    """Bake in this process: a dict of what it cost, and how near it came.

    Parameters
    ----------
    n_points : int
    out : Path
    memory : float, optional
        Gigabytes.
    tile : int, optional
        Points of a tile, whatever the memory.
    """
    if tile is not None:
        Memory.tile_points = lambda self, n_points, row_bytes: tile
    start, peaks, stage = time.process_time(), {}, ["build"]
    scene = scene_of(n_points)

    def note(progress=None):
        peaks[stage[0]] = max(peaks.get(stage[0], 0), peak_bytes())
        if progress is not None and progress.stage != stage[0]:
            stage[0] = progress.stage
            reset_peak()

    steps = bake_steps(scene, out, BakeSettings(), memory=memory)
    built = time.process_time() - start
    while True:
        try:
            note(next(steps))
        except StopIteration as end:
            report = end.value
            break
    note()
    worst = max(
        (each for item in report["certificate"] for each in item["relit"].values()),
        key=lambda estimate: estimate["error"],
        default={"error": 0.0, "low": 0.0, "high": 0.0},
    )
    shutil.rmtree(out)
    return {
        "points": report["points"],
        "tiles": report["sampling"].get("tiles", 1),
        "rays": report["rays"],
        "rays_visibility": report["rays_visibility"],
        "rays_gather": report["rays_gather"] + report["rays_short"],
        "seconds": round(time.process_time() - start - built, 1),
        "seconds_build": round(built, 1),
        "seconds_by_stage": report["seconds"],
        "memory": max(value for name, value in peaks.items() if name != "build"),
        "memory_build": peaks["build"],
        "memory_by_stage": peaks,
        "bytes": report["bytes"],
        "error": report["error"],
        "visibility_error": report["visibility_error"],
        "interval": [worst["low"], worst["high"]],
        "tolerance_met": report["tolerance_met"],
    }


def measure_worker(out):
    """Compute two tiles of a planned bake: what that took, and how much was held."""
    (stage,), clock = stages(out), [time.process_time()]
    for index in (0, 1):
        done = compute(out, stage, index)
        clock.append(time.process_time())
    first, second = np.diff(clock)
    return {
        "blocks": stage.blocks,
        "rays": done.rays,
        "seconds": round(second, 1),
        # The first one also opens the bake.
        "seconds_opening": round(max(first - second, 0), 1),
        "memory": peak_bytes(),
    }


def exponents(rows, figures=FIGURES):
    """Of each figure the slope of its logarithm over that of the points, from row to row."""
    points = np.diff(np.log([row["points"] for row in rows]))
    return {name: np.diff(np.log([row[name] for row in rows])) / points for name in figures}


def growth(rows=None):
    """Lines of the table of what bakes cost as they grow."""
    rows = rows or [_apart(n_points) for n_points in POINTS]
    lines = [
        "Sixteen balls, instances of one, over a floor, ever finer; 6,144 directions, all bounces, "
        "tolerance 1 %, Embree. `python -m tests.benchmarks.farm_tiles`: each bake in a process; "
        "seconds are those of the processor, all threads together; memory is the most that was "
        "held at once, the interpreter's 90 MB with it: while the scene is built of its meshes, "
        "and while it is baked.",
        "",
        "| points | tiles | rays, M | for visibility | for bounces | building, s | baking, s "
        "| memory building, MB | baking, MB | store, MB | visibility off by (95 %) | bounces by |",
        "|---" * 12 + "|",
    ]
    for row in rows:
        low, high = row["interval"]
        lines.append(
            f"| {row['points']:,} | {row['tiles']} | {row['rays'] / 1e6:.0f} "
            f"| {row['rays_visibility'] / 1e6:.0f} | {row['rays_gather'] / 1e6:.0f} "
            f"| {row['seconds_build']:.0f} | {row['seconds']:.0f} "
            f"| {row['memory_by_stage']['build'] / 1e6:,.0f} | {row['memory'] / 1e6:,.0f} "
            f"| {row['bytes'] / 1e6:,.0f} | {row['visibility_error']:.2%} ({low:.2%} to "
            f"{high:.2%}) | {row['error']:.2%} |"
        )
    lines += ["", "Exponents of growth with the points, from each row to the next:", ""]
    lines += ["| from | to | " + " | ".join(FIGURES.values()) + " |"]
    lines += ["|---" * (2 + len(FIGURES)) + "|"]
    slopes = exponents(rows)
    for index in range(len(rows) - 1):
        cells = " | ".join(f"{slopes[name][index]:.2f}" for name in FIGURES)
        lines.append(f"| {rows[index]['points']:,} | {rows[index + 1]['points']:,} | {cells} |")
    return lines


def further(rows, name, n_points):
    """A figure at more points, by what each point took between the last two rows."""
    before, last = rows[-2:]
    each = (last[name] - before[name]) / (last["points"] - before["points"])
    return last[name] + each * (n_points - last["points"])


def reckoned(rows=None):
    """Lines of what larger bakes would cost, by the exponents of the largest that was measured."""
    rows = rows or [_apart(n_points) for n_points in POINTS[-2:]]
    last, slopes = rows[-1], exponents(rows)
    lines = [
        "Reckoned, not measured: the last row above, with rays and seconds by the exponents of the "
        "last step; memory and bytes by what each further point took in it.",
        "",
        "| points | " + " | ".join(FIGURES.values()) + " |",
        "|---" * (1 + len(FIGURES)) + "|",
    ]
    for n_points in FURTHER:
        more = {name: further(rows, name, n_points) for name in ("memory", "memory_build", "bytes")}
        for name in ("rays", "rays_visibility", "seconds"):
            more[name] = last[name] * (n_points / last["points"]) ** slopes[name][-1]
        lines.append(
            f"| {n_points:,} | {more['rays'] / 1e9:.1f} G | {more['rays_visibility'] / 1e9:.1f} G "
            f"| {more['seconds'] / 3600:.1f} h | {more['memory'] / 1e9:.1f} GB "
            f"| {more['memory_build'] / 1e9:.1f} GB | {more['bytes'] / 1e9:.1f} GB |"
        )
    return lines


def tiles_beside(pair=None):
    """Lines of 60,000 points in tiles beside the same in one."""
    n_points = 60_000
    sizes = 2 * n_points, n_points // 3, n_points // 4
    pair = pair or [_apart(n_points, tile=tile) for tile in sizes]
    lines = [
        "The scene of 60,000 points in one tile, as it is baked, and cut into more (`python -m "
        "tests.benchmarks.farm_tiles 60000 --tile 20000`); rays of the visibility, of which the "
        "certificate's are a part. An object is cut evenly, so tiles are smaller than they may be.",
        "",
        "| tiles | rays, M | as many times | visibility off by (95 %) | tolerance met |",
        "|---|---|---|---|---|",
    ]
    for row in pair:
        low, high = row["interval"]
        lines.append(
            f"| {row['tiles']} | {row['rays_visibility'] / 1e6:.2f} "
            f"| {row['rays_visibility'] / pair[0]['rays_visibility']:.3f} "
            f"| {row['visibility_error']:.2%} ({low:.2%} to {high:.2%}) "
            f"| {'yes' if row['tolerance_met'] else 'no'} |"
        )
    return lines


def worker(rows=None):
    """Lines of what a process holds that computes blocks."""
    rows = rows or [_worker_apart(n_points) for n_points in POINTS[2:]]
    lines = [
        "`python -m tests.benchmarks.farm_tiles POINTS --worker`: a process that opens a planned "
        "bake and computes two tiles of it: memory at most, and seconds of the processor for "
        "opening it (the scene, its tree of rays, what is known of all points) and for a tile.",
        "",
        "| points | tiles | memory, MB | opening, s | a tile, s | rays of a tile, M |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row['points']:,} | {row['blocks']} | {row['memory'] / 1e6:,.0f} "
            f"| {row['seconds_opening']:.1f} | {row['seconds']:.1f} | {row['rays'] / 1e6:.2f} |"
        )
    lines += [
        "",
        f"Reckoned by what each further point took: {further(rows, 'memory', 10**7) / 1e9:.1f} GB "
        "for ten million points.",
    ]
    return lines


PAGE = "costs"
SECTIONS = {
    "Growth with the points": growth,
    "Tiles beside one": tiles_beside,
    "A process that computes blocks": worker,
    "Reckoned to a hundred million points": reckoned,
}


def _apart(n_points, out=OUT, memory=None, tile=None):
    """`measure` in a process of its own."""
    more = [] if memory is None else ["--memory", memory]
    more += [] if tile is None else ["--tile", tile]
    return _child(n_points, "--out", out, *more)


def _worker_apart(n_points, out=OUT):
    """`measure_worker` in a process of its own, of a bake that another has planned."""
    planned = _child(n_points, "--out", out, "--plan")
    return {**planned, **_child(n_points, "--out", out, "--worker")}


def _plan(n_points, out):
    scene = scene_of(n_points)
    run(plan_steps(scene, out, BakeSettings(method="agreement")))
    return {"points": len(scene.points)}


def _child(*arguments):
    command = [sys.executable, "-m", "tests.benchmarks.farm_tiles", "--child", *map(str, arguments)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def _options():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("points", nargs="*", type=int, default=POINTS)
    parser.add_argument("--tile", type=int)
    parser.add_argument("--memory", type=float)
    parser.add_argument("--out", type=Path, default=OUT)
    for name in ("child", "plan", "worker"):
        parser.add_argument(f"--{name}", action="store_true")
    return parser.parse_args()


def main():
    """Measure what is asked for, and print a JSON object a line."""
    options = _options()
    if options.child:
        n_points, out = options.points[0], options.out
        if options.plan:
            result = _plan(n_points, out)
        elif options.worker:
            result = measure_worker(out)
            shutil.rmtree(out)
        else:
            result = measure(n_points, out, options.memory, options.tile)
        print(json.dumps(result))
        return
    for n_points in options.points:
        if options.worker:
            print(json.dumps(_worker_apart(n_points, options.out)), flush=True)
            continue
        row = _apart(n_points, options.out, options.memory, options.tile)
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
