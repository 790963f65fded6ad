"""An artist's first picture, and the height of the panel (see inside/panel_story.py)."""

import numpy as np
import pytest

# Blender's sky and grid stand around: the mean of the middle may differ by so much.
_SAME = 0.02
# Pixels that a usual window is high.
_WINDOW = 1080


@pytest.fixture(scope="module")
def report(blender):
    result = blender.play("panel_story", size=(1600, 980))
    for moment in ("height", "height_baking", "height_baked"):
        print(moment, result.get(moment))
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_the_panel_is_no_higher_than_a_window(report):
    """What a view over the whole of a window of 1920 x 1080 has for it: nothing is scrolled."""
    assert report["was_baking"]
    for moment in ("height", "height_baking", "height_baked"):
        height = report[moment]
        around = height["window"] - height["region"]
        assert height["panel"] <= _WINDOW - around, (moment, height)


def test_every_mode_shows_the_same_and_no_white_floor(report):
    solid, material = (np.array(report[mode]["mean"]) for mode in ("solid", "material"))
    assert np.abs(solid - material).max() < _SAME
    assert report["solid"]["white"] < 0.02 and report["material"]["white"] < 0.02


def test_own_materials_are_seen_and_come_back(report):
    assert report["slots"] and not report["left"] and not report["modifiers"]
    own, plain = np.array(report["own"]["mean"]), np.array(report["material"]["mean"])
    assert np.abs(own - plain).max() > 0.002
