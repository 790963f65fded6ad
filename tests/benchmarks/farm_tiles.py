"""What bakes cost as they grow: `python -m tests.benchmarks.farm_tiles [POINTS ...]`.

Sixteen balls over a floor, ever finer. Each bake runs in a process of its own; seconds are those of
all its cores together, memory is the most that it held at once.

    --tiles N   sample in N tiles as well, and compare with one tile
    --out DIR   where bakes are made, and removed again
"""

import argparse
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from prt_core import BakeSettings, Scene, bake_steps
from prt_core.runtime.machine import peak_bytes, reset_peak
from tests.meshes import plane, sphere

# Balls along a side, and the share of the points that the floor has.
_SIDE, _FLOOR = 4, 0.3
_MEASURED = "rays", "rays_visibility", "seconds", "memory", "bytes"


def scene_of(n_points):
    """Balls over a floor, of about so many points."""
    rings = int(np.sqrt(n_points * (1 - _FLOOR) / _SIDE**2 / 2))
    meshes = [plane(int(np.sqrt(n_points * _FLOOR)), -2, 2, name="floor", albedo=0.6)]
    for number in range(_SIDE**2):
        row, column = divmod(number, _SIDE)
        place = (column - 1.5) * 0.9, (row - 1.5) * 0.9, 0.45
        meshes.append(sphere(rings, 0.3, place, name=f"ball {number}", albedo=(0.8, 0.5, 0.3)))
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
        kind = sys.modules["prt_core.bake.memory"].Memory
        kind.tile_points = lambda self, n_points, row_bytes: tile
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
        "memory_by_stage": peaks,
        "bytes": report["bytes"],
        "error": report["error"],
        "visibility_error": report["visibility_error"],
        "interval": [worst["low"], worst["high"]],
        "tolerance_met": report["tolerance_met"],
    }


def exponents(rows):
    """Of each figure the slope of its logarithm over that of the points, from row to row."""
    points = np.log([row["points"] for row in rows])
    return {
        name: np.round(np.diff(np.log([row[name] for row in rows])) / np.diff(points), 2).tolist()
        for name in _MEASURED
    }


def _apart(*arguments):
    """`measure` in a process of its own."""
    command = [sys.executable, "-m", "tests.benchmarks.farm_tiles", "--child", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def _options():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("points", nargs="*", type=int, default=[15_000, 60_000, 250_000, 1_000_000])
    parser.add_argument("--tiles", type=int)
    parser.add_argument("--memory", type=float)
    parser.add_argument("--tile", type=int)
    parser.add_argument("--out", type=Path, default=Path("build/farm_tiles.prt"))
    parser.add_argument("--child", action="store_true")
    return parser.parse_args()


def main():
    """Measure what is asked for, and print a JSON object a line."""
    options = _options()
    given = ["--out", options.out]
    if options.memory is not None:
        given += ["--memory", options.memory]
    if options.child:
        print(json.dumps(measure(options.points[0], options.out, options.memory, options.tile)))
        return
    rows = []
    for n_points in options.points:
        one = [*given, "--tile", n_points * 2] if options.tiles else given
        rows.append(_apart(n_points, *one))
        print(json.dumps(rows[-1]), flush=True)
        if options.tiles:
            tiled = _apart(n_points, *given, "--tile", -(-n_points // options.tiles))
            print(json.dumps(tiled), flush=True)
            print(
                json.dumps({"rays, tiled": tiled["rays_visibility"] / rows[-1]["rays_visibility"]})
            )
    if len(rows) > 1:
        print(json.dumps(exponents(rows)))


if __name__ == "__main__":
    main()
