"""Blender is closed while it bakes: it ends well, and the next run goes on from there."""

import shutil

from prt_core import BakeStore, PRTError, load
from tests.window.conftest import ROOT


def test_a_bake_that_the_window_was_closed_on_goes_on(blender):
    shutil.copy(ROOT / "blend_scenes" / "01_model_on_ground.blend", blender.folder / "quit.blend")
    report = blender.play("quit_story")
    assert report["error"] is None, report["error"] + report["said_all"]
    assert report["running"] and report["code"] == 0, report["said_all"]
    assert not any("prt_" in line for line in report["said_all"].splitlines() if "File" in line)
    path = blender.folder / "prt" / "quit.prt"
    assert BakeStore(path).attributes["complete"] is False
    try:
        load(path)
    except PRTError as error:
        assert "not finished" in str(error)
    else:
        raise AssertionError("an unfinished bake was read as if it were whole")
    done = blender.run(
        "-b", "quit.blend", "--addons", "bl_ext.user_default.prt_relight", "--command", "prt",
        "bake", "-o", "prt/quit.prt", "--tolerance", "0.01", user="user",
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert load(path).transport.n_points > 60000
