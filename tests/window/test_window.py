"""The extension in a real window, by real clicks and keys (see inside/relight_story.py)."""

import shutil
from itertools import groupby

import numpy as np
import pytest

from tests.window.conftest import ROOT


@pytest.fixture(scope="module")
def report(blender):
    scene = ROOT / "blend_scenes" / "02_model_on_ground_small.blend"
    shutil.copy(scene, blender.folder / "scene.blend")
    result = blender.play("relight_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_the_zip_is_installed_and_nothing_is_held_against_it(report, blender):
    assert report["enabled"] and report["warnings"] == "{}"
    assert report["core"].startswith(f"{blender.inside}/user/")
    # A distribution's Blender may have troubles of its own; none may come from here.
    lines = report["said_all"].splitlines()
    ours = [line for line in lines if 'File "' in line and ("prt_" in line or "/play.py" in line)]
    assert not ours, report["said_all"]


def test_the_bake_shows_its_progress_and_ends_in_colours(report):
    seen = report["progress"]
    stages = {stage for stage, _ in seen}
    # Any short stage may end between two looks, but not all that cast rays.
    assert "scene" in stages and len(stages) >= 3, seen
    assert stages & {"visibility", "certificate", "gather", "bounces"}, seen
    for _, looks in groupby(seen, key=lambda look: look[0]):
        shares = [done for _, done in looks]
        assert shares == sorted(shares), seen
    assert report["said"].startswith("Baked ")
    assert not faults(report["baked"])


def test_a_stopped_bake_goes_on_and_ends_the_same(report):
    stopped = report["stopped"]
    assert "stopped" in stopped["said"] and stopped["complete_then"] is False
    assert stopped["said_at_the_end"].startswith("Baked ")
    assert stopped["same"] == [True, True]


STEPS = ["rotation", "world", "sun", "frame 1", "played", "turned again", "undone", "redone",
         "reloaded"]  # fmt: skip


@pytest.mark.parametrize("step", STEPS)
def test_colours_are_those_of_the_api(report, step):
    assert not faults(report["light"][step])


def faults(found):
    """What is wrong with the colours of a step, in words."""
    shown, wanted = found["objects"]
    wrong = {
        "objects": shown != wanted or len(wanted) != 2,
        "difference": found["difference"] != 0,
        "failed": found["failed"],
        "black": min(np.ravel(list(found["mean"].values()))) <= 0,
    }
    return {what: found for what, is_so in wrong.items() if is_so}


def test_every_step_changed_the_colours(report):
    assert abs(report["turned"]) > 1
    means = {step: report["light"][step]["mean"] for step in STEPS}
    means["baked"] = report["baked"]["mean"]
    order = ["baked", "rotation", "world", "sun"]
    for before, after in zip(order, order[1:], strict=False):
        assert means[before] != means[after], after
    # Blender 4.3 goes back to the frame of the step before as well, 5.2 does not.
    assert means["undone"] in (means["frame 1"], means["played"])
    assert means["frame 1"] == means["sun"] and means["undone"] != means["turned again"]
    assert means["redone"] == means["turned again"] == means["reloaded"]


def test_playback_follows(report):
    assert len(report["played"]["frames"]) >= 5 and report["played"]["colours"] >= 3


def test_restore_takes_everything_off(report):
    assert report["left"] == []
