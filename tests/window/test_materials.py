"""Six materials, an image and a sun in a real window (see inside/materials_story.py)."""

import numpy as np
import pytest

OBJECTS = {"floor", "wall", "chrome", "gold", "glass", "lacquer", "tube"}
# How far the pictures of objects may be from Cycles' own, relative L2, a little above what was
# measured. Without gloss what metal, glass and lacquer reflect is only bright about as it should be
# (see test_workflows for the same scene with gloss).
APART = {"floor": 0.12, "wall": 0.08, "lacquer": 0.65, "gold": 0.95, "chrome": 1.1, "glass": 1.2}
# How far their mean brightness may be off: the floor and the wall lack their own gloss.
BRIGHTNESS = {"floor": 0.12, "wall": 0.13, "lacquer": 0.5, "gold": 0.4, "chrome": 0.4, "glass": 1.1}


@pytest.fixture(scope="module")
def report(blender):
    result = blender.play("materials_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_nothing_is_black_that_is_not(report):
    baked = {name: np.mean(colour) for name, colour in report["baked"].items()}
    assert set(baked) == OBJECTS
    # Chrome is as bright as what it reflects, gold keeps its colour.
    assert min(baked.values()) > 0.15 * baked["floor"], baked
    red, _, blue = report["baked"]["gold"]
    assert red > 1.5 * blue


def test_what_is_only_near_is_said_in_few_lines(report):
    said = " ".join(report["notes"])
    for word in ("chrome", "glass"):
        assert word in said, report["notes"]
    assert len(report["notes"]) < 8, report["notes"]


def test_the_neon_changes_while_one_watches(report):
    # The lamps stayed as they were, so the first colours are those of all rays.
    assert [len(delays) for delays in report["delays"]] == [1, 1, 1]
    print("seconds to colours of the neon:", np.round(np.ravel(report["delays"]), 2))
    before, after = report["baked"], report["recoloured"]
    # Pink became green, on the tube and on the wall behind it.
    for name in ("tube", "wall"):
        gain = np.subtract(after[name], before[name])
        assert gain[1] > 0 and gain[1] > gain[2], (name, gain)


def test_pictures_are_near_cycles_own(report):
    assert report["cycles"].keys() == APART.keys()
    for name, found in report["cycles"].items():
        assert found["l2"] < APART[name], (name, found)
        assert abs(np.mean(found["ratio"]) - 1) < BRIGHTNESS[name], (name, found)
