"""What moved is baked again by a button in a real window (see inside/moved_story.py)."""

import shutil

import pytest

from tests.window.conftest import ROOT


@pytest.fixture(scope="module")
def report(blender):
    scene = ROOT / "blend_scenes" / "02_model_on_ground_small.blend"
    shutil.copy(scene, blender.folder / "scene.blend")
    result = blender.play("moved_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_the_button_is_there_where_something_moved_and_says_what_it_did(report):
    assert "model changed" in report["warned"]
    assert report["said updated"].startswith("model moved: ")
    assert "% of the rays of a whole bake" in report["said updated"]
    assert not report["offered after"]


def test_colours_are_those_of_a_whole_bake(report):
    assert report["off"] < 0.02
    for step in ("before", "updated", "whole", "selected"):
        assert report["light"][step]["difference"] < 1e-5 and not report["light"][step]["failed"]


def test_a_selection_leaves_the_others(report):
    assert report["kept"]["ground"] < min(0.02, report["kept"]["model"])
