"""Shares of a light field by Cycles, and of a sequence, by two and by four processes at once.

    python -m tests.benchmarks.farm_shares               # about two minutes of a core each
    python -m tests.benchmarks.farm_shares --sequence    # the second alone

Each process is a command as a machine of a farm runs it; one of four is killed in the midst and
run again. Floor: the digests, and the pictures, of one process.
"""

import argparse
import hashlib
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import OpenEXR

from prt_core import BakeSettings, bake_steps, run
from prt_core.store import BakeStore
from tests.benchmarks.farm_workers import scene

ROOT = Path(__file__).resolve().parents[2]
BLEND = ROOT / "blend_scenes" / "08_two_triangle_floor.blend"
# Blocks of 128 points.
FLAGS = ["--objects", "ball", "--lamps", "--denoise", "--angles", "16x8", "--samples", "256"]
N_FRAMES = 12


def prt(*words):
    """A process of the command line, begun; its cores are shared as the system does it."""
    command = [sys.executable, "-m", "prt_core", *map(str, words)]
    return subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def ended(*processes):
    """Wait for processes that must end well; what they said."""
    said = [process.communicate()[0] for process in processes]
    for process, text in zip(processes, said, strict=True):
        if process.returncode:
            sys.exit(f"{' '.join(process.args)}\n{text}")
    return said


def killed(process, has_begun):
    """Kill a process once it has done a part of its share; whether it was at work."""
    while not has_begun() and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    return process.returncode == -signal.SIGKILL


def light_field(folder, counts=(2, 4)):
    """Lines on shares of a light field."""
    line = ["lightfield", "bake", BLEND, *FLAGS, "--quiet", "-o"]
    if not (folder / "alone.slf").exists():
        ended(prt(*line, folder / "alone.slf"))
    alone = BakeStore(folder / "alone.slf").attributes
    for count in counts:
        path = folder / f"{count}.slf"
        planned = ended(prt(*line, path, "--plan"))[0]
        shares = [[*line, path, "--share", f"{number}/{count}"] for number in range(count)]
        begun = [prt(*share) for share in shares]
        kills = 0
        if count == 4:
            # When the first block is written, by whomever: the others are being rendered.
            kills += killed(begun.pop(0), lambda path=path: any(path.glob("noisy/c/0/*/**/0")))
            begun.append(prt(*shares[0]))
        said = "; ".join(text.rsplit(": ", 1)[-1].split(";")[0] for text in ended(*begun))
        # All is there by now: the pilot is shot again, and the light field closed.
        closed = time.perf_counter()
        ended(prt(*line, path))
        yield verdict(
            f"{count} Blenders at once, {kills} killed: {alone['report']['points']:,} points, "
            f"{planned.split(': ')[1].split(' planned')[0]} ({said}), closed in "
            f"{time.perf_counter() - closed:.0f} s",
            BakeStore(path).attributes["arrays"] == alone["arrays"],
        )


def sequence(folder):
    """Lines on shares of a turn."""
    bake, light = folder / "a.prt", folder / "light.exr"
    run(bake_steps(scene(60), bake, BakeSettings(resolution=16, tolerance=0.05)))
    pixels = np.random.default_rng(0).random((32, 64, 3)).astype(np.float32)
    OpenEXR.File({}, {"RGB": pixels}).write(str(light))
    line = ["relight", bake, "--light", light, "--turn", N_FRAMES, "--size", "96x54", "--png"]
    for name in ("alone", "2", "4"):
        (folder / name).mkdir()
    ended(prt(*line, folder / "alone" / "turn.png"))
    for count in (2, 4):
        to = folder / str(count)
        step = N_FRAMES // count
        shares = [
            [*line, to / "turn.png", "--frames", f"{first}-{first + step - 1}"]
            for first in range(1, N_FRAMES + 1, step)
        ]
        begun, kills = [prt(*share) for share in shares], 0
        if count == 4:
            kills += killed(begun.pop(0), lambda to=to: any(to.glob("turn*01.png")))
            begun.append(prt(*shares[0]))
        ended(*begun)
        same = digests(to) == digests(folder / "alone")
        yield verdict(f"a turn of {N_FRAMES} by {count} at once, {kills} killed", same)


def digests(folder):
    """{name: digest} of the files of a folder."""
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir()}


def verdict(what, same):
    """A line, and whether it is as it should be."""
    return f"{what}: {'equal' if same else 'DIFFERENT'} to one process", same


def main():
    """Measure what is asked for, and print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sequence", action="store_true")
    options = parser.parse_args()
    all_same = True
    for part in (sequence,) if options.sequence else (light_field, sequence):
        with tempfile.TemporaryDirectory() as folder:
            for line, same in part(Path(folder)):
                print(line, flush=True)
                all_same &= same
    return not all_same


if __name__ == "__main__":
    sys.exit(main())
