"""A bake at an address of an object store: killed, gone on with, relit; against one in a folder.

    npm install azurite && npx azurite-blob --inMemoryPersistence --disableTelemetry
    AZURE_STORAGE_USE_EMULATOR=true AZURE_STORAGE_ACCOUNT_NAME=devstoreaccount1 \
        AZURE_STORAGE_ACCOUNT_KEY=... python -m tests.benchmarks.farm_stores az://container
    moto_server & AWS_ENDPOINT_URL=http://127.0.0.1:5000 … python -m … farm_stores s3://bucket

The container is there; what lies in it below `farm_stores` is replaced. Each step is a process of
its own, and the one that computes blocks is killed three times. Floor: the digests and the relit
colours of a folder.
"""

import contextlib
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import OpenEXR

from prt_core import BakeSettings, PRTError, bake_steps, run
from prt_core.bake.plan import plan_steps
from prt_core.store import BakeStore, remove_bake
from tests.benchmarks.farm_workers import scene

KILLS = 3
SETTINGS = BakeSettings(resolution=8, bounces=1, method="exhaustive")


def prt(*words):
    """A process of the command line, begun."""
    command = [sys.executable, "-m", "prt_core", *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def main():
    """Try one address, and print what came of it."""
    (home,) = sys.argv[1:]
    address, built, rng = f"{home}/farm_stores/a.prt", scene(100), random.Random(0)
    with contextlib.suppress(PRTError):
        remove_bake(address)
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        run(bake_steps(built, folder / "a.prt", SETTINGS))
        run(plan_steps(built, address, SETTINGS))
        begun, kills = time.perf_counter(), 0
        for _ in range(KILLS):
            work = prt("bake", "--finish", address, "--compute", "--quiet")
            # Loading takes the first seconds; it is killed while it computes and writes.
            while len(BakeStore(address).files.keys("visibility")) < 2 + kills:
                if work.poll() is not None:
                    break
            time.sleep(rng.uniform(0, 0.5))
            work.send_signal(signal.SIGKILL)
            work.communicate()
            kills += work.returncode == -signal.SIGKILL
        work = prt("bake", "--finish", address, "--compute", "--quiet")
        said = work.communicate()[0]
        seconds = time.perf_counter() - begun
        same = BakeStore(address).attributes.get("arrays")
        same = same == BakeStore(folder / "a.prt").attributes["arrays"]
        light = np.random.default_rng(0).random((16, 32, 3)).astype(np.float32)
        OpenEXR.File({}, {"RGB": light}).write(str(folder / "light.exr"))
        colours = []
        for place in (address, folder / "a.prt"):
            output = folder / f"{len(colours)}.npz"
            relit = prt("relight", place, "--light", folder / "light.exr", "--output", output)
            said += relit.communicate()[0]
            with np.load(output) as values:
                colours.append(np.concatenate([values[name] for name in sorted(values)]))
        relit = np.array_equal(*colours)
        remove_bake(address)
    print(
        f"{home}: {len(built.points):,} points, {kills} kills in {seconds:.0f} s; digests "
        f"{'equal' if same else 'DIFFERENT'} to those in a folder, colours "
        f"{'equal' if relit else 'DIFFERENT'}"
    )
    if not (same and relit and kills == KILLS):
        sys.exit(said)


if __name__ == "__main__":
    main()
