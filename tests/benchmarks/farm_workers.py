"""Workers of a Dask cluster on this machine: what two gain, what scheduling costs, and kills.

    python -m tests.benchmarks.farm_workers           # the first two; nothing else must run
    python -m tests.benchmarks.farm_workers --kills   # ten at random moments, digests compared
    python -m tests.benchmarks.farm_workers --digests # four workers, and an array of four in bash

Floors: equal digests; two workers of one thread 1.7 times one; scheduling 5 % of blocks of 2,048
points.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from prt_core import BakeSettings, Scene, bake_steps, run
from prt_core.bake.blocks import block_figures, stages
from prt_core.bake.distribute import cluster_client, distribute_steps
from prt_core.bake.plan import plan_steps
from prt_core.store import BakeStore
from tests.meshes import plane, sphere

_STAGE = "visibility"


def scene(side):
    """A ball over a floor of side x side vertices."""
    ball = sphere(64, centre=(0, 0, 0.6), radius=0.4, name="ball")
    floor = plane(side, -1.2, 1.2, name="floor", albedo=0.7)
    return Scene.from_meshes([ball, floor], max_hidden=0)


def timed(scene, settings, folder, n_workers):
    """Seconds of the clock that workers take for blocks of visibility, and the blocks' own sum."""
    path = Path(folder) / f"{n_workers}.prt"
    run(plan_steps(scene, path, settings))
    times, figures = [], []

    def note(progress):
        if progress.stage == _STAGE and progress.total == stages(path)[0].blocks:
            times.append(time.perf_counter())
        elif times and not figures:
            figures.append(block_figures(path, _STAGE)[:, 0].sum())

    with cluster_client(f"local:{n_workers}") as client:
        warm = Path(folder) / f"warm{n_workers}.prt"
        run(plan_steps(scene_small(), warm, settings))
        run(distribute_steps(warm, client))
        client.run(_ready, str(path))
        steps = distribute_steps(path, client)
        for progress in steps:
            note(progress)
            if figures:
                break
        steps.close()
    return times[-1] - times[0], float(figures[0])


def scene_small():
    """For workers to load what they need."""
    return scene(24)


def _ready(path):
    """Let a worker read the scene of a store and build what casts its rays."""
    from prt_core.bake import blocks

    blocks._workplace(BakeStore(path))


def kills(folder, n_kills, seed=0, n_workers=2, side=160):
    """Whether a bake during which workers are killed has the digests of one process."""
    built, settings = scene(side), BakeSettings(resolution=16, bounces=2, method="exhaustive")
    alone, path = Path(folder) / "alone.prt", Path(folder) / "killed.prt"
    run(bake_steps(built, alone, settings))
    run(plan_steps(built, path, settings))
    rng, done, ended = random.Random(seed), [], threading.Event()
    with cluster_client(f"local:{n_workers}") as client:

        def kill():
            while len(done) < n_kills and not ended.is_set():
                time.sleep(rng.uniform(0.3, 1.2))
                pids = list(client.run(os.getpid, on_error="ignore").values())
                if pids and not ended.is_set():
                    os.kill(rng.choice(pids), signal.SIGKILL)
                    done.append(time.perf_counter())

        killer = threading.Thread(target=kill)
        killer.start()
        begun = time.perf_counter()
        run(distribute_steps(path, client))
        ended.set()
        killer.join()
    same = BakeStore(path).attributes["arrays"] == BakeStore(alone).attributes["arrays"]
    return same, len(done), time.perf_counter() - begun


# Four jobs at once for each stage, until nothing is missing.
_ARRAY = """
while true; do
    $PRT bake --finish "$1" --quiet; code=$?
    [ $code -eq 3 ] || exit $code
    for i in 0 1 2 3; do PRT_THREADS=1 $PRT bake-blocks "$1" --quiet --share $i/4 & done
    wait
done
"""


def digests(folder, side=60):
    """(who, whether its bake has the digests of one process of one thread) of each way."""
    built, settings = scene(side), BakeSettings(resolution=8, bounces=2, method="exhaustive")
    folder = Path(folder)

    def digests_of(name):
        return BakeStore(folder / name).attributes["arrays"]

    with _threads(1):
        run(bake_steps(built, folder / "alone.prt", settings))
    alone = digests_of("alone.prt")
    run(plan_steps(built, folder / "dask.prt", settings))
    with cluster_client("local:4") as client:
        run(distribute_steps(folder / "dask.prt", client))
    yield "four workers of Dask", digests_of("dask.prt") == alone
    run(plan_steps(built, folder / "array.prt", settings))
    done = subprocess.run(
        ["bash", "-c", _ARRAY, "array", folder / "array.prt"],
        env={**os.environ, "PRT": f"{sys.executable} -m prt_core"}, capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"farm_workers: the array ended badly\n{done.stdout}{done.stderr}")
    yield "an array of four in bash", digests_of("array.prt") == alone
    with _threads(2):
        run(bake_steps(built, folder / "threads.prt", settings))
    yield "two threads", digests_of("threads.prt") == alone


@contextmanager
def _threads(count):
    os.environ["PRT_THREADS"] = str(count)
    try:
        yield
    finally:
        del os.environ["PRT_THREADS"]


def speed(side=200, resolution=24):
    """(points, seconds of one worker, of two, of the blocks alone)."""
    os.environ["PRT_THREADS"] = "1"
    built = scene(side)
    settings = BakeSettings(resolution=resolution, bounces=2, method="exhaustive")
    with tempfile.TemporaryDirectory() as folder:
        one, alone = timed(built, settings, folder, 1)
        two, _ = timed(built, settings, folder, 2)
    return len(built.points), one, two, alone


def killed(n_kills=10, n_workers=2):
    """(number of kills, whether the digests are equal, seconds)."""
    with tempfile.TemporaryDirectory() as folder:
        same, count, seconds = kills(folder, n_kills, n_workers=n_workers)
    return count, same, seconds


def workers(measured=None, ends=None):
    """Lines of what workers gain, cost and survive; none where Dask is not installed."""
    if not find_spec("distributed"):
        return []
    points, one, two, alone = measured or speed()
    count, same, seconds = ends or killed()
    return [
        "`python -m tests.benchmarks.farm_workers`: every entry of a ball over a floor, "
        f"{points:,} points in blocks of 2,048, by Dask's workers of one thread on this machine; "
        "the time from the first block that is sent to the last one that is back.",
        "",
        "| | | floor |",
        "|---|---|---|",
        f"| one worker | {one:.1f} s | |",
        f"| two workers | {two:.1f} s: {one / two:.2f} times as quick | 1.7 |",
        f"| scheduling, and finding out what is done | {one / alone - 1:.1%} of the blocks' own "
        f"{alone:.1f} s | 5 % |",
        f"| two workers, of which one was killed {count} times | {seconds:.0f} s, digests "
        f"{'equal' if same else 'DIFFERENT'} to those of one process | equal |",
    ]


PAGE, SECTIONS = "costs", {"Workers": workers}


def main():
    """Measure what is asked for, and print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", action="store_true")
    parser.add_argument("--workers", type=int, default=2, help="of which some are killed")
    parser.add_argument("--digests", action="store_true")
    parser.add_argument("--side", type=int, default=200, help="vertices along the floor")
    parser.add_argument("--resolution", type=int, default=24)
    options = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores", flush=True)
    if options.digests:
        with tempfile.TemporaryDirectory() as folder:
            for who, same in digests(folder):
                print(f"{who}: digests {'equal' if same else 'DIFFER'}", flush=True)
        return
    if options.kills:
        count, same, seconds = killed(n_workers=options.workers)
        print(f"{count} kills in {seconds:.0f} s: digests {'equal' if same else 'DIFFER'}")
        return
    points, one, two, alone = speed(options.side, options.resolution)
    print(f"{points:,} points, {options.resolution} texels along an edge")
    print(f"one worker {one:.1f} s, two {two:.1f} s: {one / two:.2f} times (floor 1.7)")
    print(f"scheduling {100 * (one / alone - 1):.1f} % of the blocks' {alone:.1f} s (floor 5 %)")


if __name__ == "__main__":
    main()
