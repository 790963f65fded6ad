"""docs/farm/slurm_array.sh on a real SLURM of one node: two jobs at once, one killed, digests.

    apt-get install slurm-wlm munge
    python -m tests.benchmarks.farm_slurm        # as root, nothing else of SLURM running

The controller, the node and their keys are of this run alone; the node says it has twice its
cores, so that two jobs of two run at once, and the script itself as a third. Floor: the digests of
one process, from the login node, with a job killed, and as a job by sbatch.
"""

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from pathlib import Path

from prt_core import BakeSettings, bake_steps, run
from prt_core.bake.plan import plan_steps
from prt_core.store import BakeStore
from tests.benchmarks.farm_workers import scene

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "docs" / "farm" / "slurm_array.sh"
SETTINGS = BakeSettings(resolution=16, bounces=2, method="exhaustive")
CONFIG = """
ClusterName=one
SlurmctldHost={host}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
NodeName={host} CPUs={cores} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


@contextmanager
def one_node(folder):
    """A SLURM of this machine alone, below a folder; its environment."""
    folder.chmod(0o755)
    for name in ("state", "spool"):
        (folder / name).mkdir()
    config = folder / "slurm.conf"
    config.write_text(
        CONFIG.format(host=socket.gethostname(), folder=folder, cores=2 * os.cpu_count() + 1)
    )
    key = folder / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o600)
    environment = {**os.environ, "SLURM_CONF": str(config), "PYTHONPATH": str(ROOT),
                   "PRT": f"{sys.executable} -m prt_core"}  # fmt: skip
    paths = [f"--{name}={folder}/munge.{name}" for name in ("socket", "pid-file", "log-file")]
    paths += [f"--key-file={key}", f"--seed-file={folder}/munge.seed"]
    commands = [
        ["munged", "--foreground", "--force", *paths],
        ["slurmctld", "-D"],
        ["slurmd", "-D"],
    ]
    daemons = []
    try:
        for command in commands:
            daemons.append(
                subprocess.Popen(
                    command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
                )
            )
            time.sleep(2)
        for _ in range(30):
            state = subprocess.run(
                ["sinfo", "-h", "-o", "%T"], env=environment, capture_output=True, text=True
            )
            if state.stdout.strip() == "idle":
                break
            time.sleep(1)
        else:
            sys.exit(f"farm_slurm: no node came up\n{state.stderr}{state.stdout}")
        yield environment
    finally:
        for daemon in reversed(daemons):
            daemon.terminate()
            daemon.wait()


def main():
    """Bake by arrays of two jobs, three times, and compare with one process."""
    missing = [name for name in ("munged", "slurmctld", "slurmd") if not shutil.which(name)]
    if missing:
        sys.exit(f"farm_slurm: {missing[0]} is missing; apt-get install slurm-wlm munge")
    built = scene(160)
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        run(bake_steps(built, folder / "alone.prt", SETTINGS))
        alone = BakeStore(folder / "alone.prt").attributes["arrays"]
        wrong = False
        with one_node(folder) as environment:
            version = subprocess.check_output(["sbatch", "--version"], text=True, env=environment)
            version = version.strip()
            for what, command, kills in (
                ("bash slurm_array.sh", ["bash"], 0),
                ("with a job killed", ["bash"], 1),
                ("sbatch slurm_array.sh", ["sbatch", "--wait", "--cpus-per-task=1"], 0),
            ):
                path, begun = folder / f"{len(what)}.prt", time.perf_counter()
                run(plan_steps(built, path, SETTINGS))
                at_once = _array(
                    [*command, str(SCRIPT), str(path), "2"], environment, folder, kills
                )
                store = BakeStore(path)
                same = store.is_complete and store.attributes["arrays"] == alone
                wrong |= not same or at_once < 2
                print(
                    f"{version}, {what}: {len(built.points):,} points by 2 jobs of 2 cores, "
                    f"{at_once} at once, in {time.perf_counter() - begun:.0f} s; digests "
                    f"{'equal' if same else 'DIFFERENT'} to those of one process",
                    flush=True,
                )
    return wrong


def _array(command, environment, folder, kills):
    """Run the script to its end; returns how many jobs of arrays ran at once at most."""
    most, ended = [0], threading.Event()

    def watch():
        left = kills
        while not ended.wait(0.3):
            shown = subprocess.run(
                ["squeue", "-h", "-r", "-t", "running", "-o", "%i"],
                env=environment, capture_output=True, text=True,
            )  # fmt: skip
            jobs = [job for job in shown.stdout.split() if "_" in job]
            most[0] = max(most[0], len(jobs))
            if left and len(jobs) > 1:
                # In the midst of its blocks.
                time.sleep(4)
                subprocess.run(["scancel", "--signal=KILL", "--full", jobs[0]], env=environment)
                left -= 1

    watcher = threading.Thread(target=watch)
    watcher.start()
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    ended.set()
    watcher.join()
    if done.returncode:
        print(done.stdout, done.stderr, *(p.read_text() for p in folder.glob("slurm-*.out")))
    return most[0]


if __name__ == "__main__":
    sys.exit(main())
