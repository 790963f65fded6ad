"""`blender -b scene.blend --command prt …`, with the extension installed, against the API."""

import shutil

import numpy as np
import pytest

import prt_core
from tests.window.conftest import ROOT

BLEND = ROOT / "blend_scenes" / "08_two_triangle_floor.blend"


@pytest.fixture(scope="module")
def prt(blender):
    """Runs `prt` in that Blender on a copy of the scene."""
    shutil.copy(BLEND, blender.folder / "floor.blend")
    install = ["extension", "install-file", "--repo", "user_default", "--enable", "extension.zip"]
    done = blender.run("-b", "--command", *install, user="headless")
    assert done.returncode == 0, done.stdout + done.stderr

    def run(*arguments):
        return blender.run("-b", "floor.blend", "--command", "prt", *arguments, user="headless")

    return run


def test_bake_and_relight(prt, blender):
    for arguments in (
        ("bake", "-o", "floor.prt", "--resolution", 8, "--tolerance", 0.02),
        ("relight", "floor.prt", "--light", "world", "--output", "floor.npz"),
    ):
        done = prt(*arguments)
        assert done.returncode == 0, done.stdout + done.stderr
    blender.bring_scripts()
    # In the same Blender: another rounds normals in another way.
    done = blender.run("-b", "floor.blend", "-P", "api.py", user="headless")
    result, wanted = (prt_core.BakeStore(blender.folder / f"{n}.prt") for n in ("floor", "api"))
    assert result.attributes["report"]["back_end"] == "embree"
    assert result.attributes["identity"] == wanted.attributes["identity"], done.stdout + done.stderr
    for name in ("visibility", "gather"):
        np.testing.assert_array_equal(result.read(name), wanted.read(name))
    with np.load(blender.folder / "floor.npz") as one, np.load(blender.folder / "api.npz") as two:
        assert set(one) == set(two) == {"floor", "ball"}
        for name in one:
            np.testing.assert_array_equal(one[name], two[name])


def test_errors_reach_the_exit_code(prt):
    done = prt("bake", "-o", "nobody.prt", "--objects", "nobody")
    assert done.returncode == 2 and "'nobody'" in done.stderr + done.stdout
