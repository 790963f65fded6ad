"""The scripts of docs/farm: arrays of SLURM in bash, and the job type of Flamenco, by node."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from prt_core import BakeSettings, Scene, bake_steps, run
from prt_core.bake.plan import plan_steps
from prt_core.cli import main
from prt_core.store import BakeStore
from tests.meshes import plane, sphere

ROOT = Path(__file__).parents[3]
FARM = ROOT / "docs" / "farm"
SETTINGS = BakeSettings(resolution=6, bounces=0, method="exhaustive")
# What sbatch does: so many jobs, which are told their numbers, and a wait for all of them.
SBATCH = """#!/bin/bash
[ "$1" = --wait ] || exit 9
last=${2#--array=0-}; shift 2
for i in $(seq 0 "$last"); do
    SLURM_ARRAY_TASK_ID=$i SLURM_ARRAY_TASK_MIN=0 SLURM_ARRAY_TASK_COUNT=$((last + 1)) \
        SLURM_CPUS_PER_TASK=1 bash "$@" >"job$i.log" 2>&1 &
done
wait
"""


def scene():
    """Of three blocks."""
    return Scene.from_meshes([sphere(20, 0.3, (0, 0, 0.5)), plane(66)], max_hidden=0)


@pytest.fixture
def planned(tmp_path):
    run(plan_steps(scene(), tmp_path / "a.prt", SETTINGS))
    return tmp_path / "a.prt"


@pytest.mark.skipif(sys.platform == "win32", reason="bash")
def test_an_array_of_slurm_bakes_the_same_bytes(planned, tmp_path):
    sbatch = tmp_path / "sbatch"
    sbatch.write_text(SBATCH)
    sbatch.chmod(0o755)
    environment = {
        **os.environ,
        "PATH": f"{tmp_path}:{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "PRT": f"{sys.executable} -m prt_core",
    }
    command = ["bash", str(FARM / "slurm_array.sh"), str(planned), "3"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    logs = [(tmp_path / f"job{i}.log").read_text() for i in range(3)]
    assert done.returncode == 0, (done.stdout, done.stderr, logs)
    run(bake_steps(scene(), tmp_path / "b.prt", SETTINGS))
    whole = BakeStore(tmp_path / "b.prt").attributes["arrays"]
    assert BakeStore(planned).attributes["arrays"] == whole
    assert all(log.startswith(f"visibility {i}:") for i, log in enumerate(logs)), logs


def test_shares_of_a_stage_make_up_the_whole(planned, capsys):
    for share in ("3/3", "0/0", "x", "1", "-1/2"):
        assert main(["bake-blocks", str(planned), f"--share={share}"]) == 2
        assert "--share: expected I/N" in capsys.readouterr().err
    assert main(["bake-blocks", str(planned), "--share", "0/2", "--blocks", "0"]) == 2
    assert main(["bake", "--finish", str(planned), "--quiet"]) == 3
    capsys.readouterr()
    assert main(["bake", "--finish", str(planned), "--quiet", "--open"]) == 0
    assert "stage 'visibility' missing" in capsys.readouterr().out
    indices = []
    for share in ("0/2", "1/2"):
        assert main(["bake-blocks", str(planned), "--share", share, "--json"]) == 0
        indices.append([block["index"] for block in json.loads(capsys.readouterr().out)])
    assert indices == [[0, 2], [1]]
    assert main(["bake", "--finish", str(planned), "--quiet"]) == 0
    assert main(["bake-blocks", str(planned), "--share", "0/2"]) == 0
    assert "finished, nothing is left" in capsys.readouterr().out


_AUTHOR = """
const tasks = [];
const author = {
    Task: (name, kind) => ({ name, commands: [], after: [],
        addCommand(each) { this.commands.push(each) },
        addDependency(each) { this.after.push(each.name) } }),
    Command: (name, given) => [name, given.exe, ...given.args],
};
"""
_COMPILED = """
const settings = Object.fromEntries(JOB_TYPE.settings.map((each) => [each.key, each.default]));
compileJob({ settings: { ...settings, blendfile: "a.blend", output: "a.prt", options: "--gloss",
    shares: 2, stages: 2 }, addTask: (each) => tasks.push(each) });
console.log(JSON.stringify(tasks));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="no node")
def test_the_job_type_of_flamenco_calls_commands_that_exist(tmp_path):
    script = tmp_path / "compiled.js"
    script.write_text(_AUTHOR + (FARM / "flamenco_prt_bake.js").read_text() + _COMPILED)
    tasks = json.loads(subprocess.check_output(["node", str(script)], text=True))
    assert [task["name"] for task in tasks] == [
        "plan", "stage 1, share 1", "stage 1, share 2", "close stage 1",
        "stage 2, share 1", "stage 2, share 2", "close stage 2",
    ]  # fmt: skip
    assert tasks[1]["after"] == ["plan"]
    assert tasks[3]["after"] == ["stage 1, share 1", "stage 1, share 2"]
    lines = [" ".join(command) for task in tasks for command in task["commands"]]
    assert lines[0] == "exec prt bake a.blend --plan -o a.prt --quiet --gloss"
    assert lines[2] == "exec prt bake-blocks a.prt --quiet --share 1/2"
    assert lines[3] == "exec prt bake --finish a.prt --quiet --open"
    assert lines[6] == "exec prt bake --finish a.prt --quiet --compute"
