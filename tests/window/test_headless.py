"""Inside a real Blender (BLENDER=…): the command line's script gives what the API gives."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import prt_core

ROOT = Path(__file__).resolve().parents[2]
BLEND = ROOT / "blend_scenes" / "08_two_triangle_floor.blend"


@pytest.fixture(scope="module")
def blender():
    found = os.environ.get("BLENDER") or shutil.which("blender")
    if not found:
        pytest.fail("set BLENDER=/path/to/blender for the window tests")

    def run(*arguments):
        script = ROOT / "scripts" / "blender_prt.py"
        command = [found, "-b", BLEND, "--python-exit-code", "1", "-P", script, "--"]
        return subprocess.run(
            [str(part) for part in (*command, *arguments)], capture_output=True, text=True
        )

    return run


def test_bake_and_relight(blender, tmp_path):
    options = ("--resolution", 8, "--tolerance", 0.02, "--caster", "blender")
    done = blender("bake", "-o", tmp_path / "h.prt", *options)
    assert done.returncode == 0, done.stdout + done.stderr
    bake = prt_core.load(tmp_path / "h.prt")
    assert bake.report["back_end"] == "blender"
    prt_core.bake(BLEND, tmp_path / "m.prt", resolution=8, tolerance=0.02, caster="blender")
    module = prt_core.load(tmp_path / "m.prt")
    np.testing.assert_array_equal(bake.transport.bits, module.transport.bits)
    out = tmp_path / "h.npz"
    done = blender("relight", tmp_path / "h.prt", "--light", "world", "--output", out)
    assert done.returncode == 0, done.stdout + done.stderr
    colours = prt_core.relight(bake, "world")
    found = np.load(out)
    for name, wanted in colours.items():
        np.testing.assert_array_equal(found[name], wanted)


def test_errors_reach_the_exit_code(blender, tmp_path):
    done = blender("bake", "-o", tmp_path / "n.prt", "--objects", "nobody")
    assert done.returncode != 0 and "'nobody'" in done.stderr + done.stdout
