"""A bake in a real window that shows itself while it runs (see inside/showing_story.py)."""

import shutil

import pytest

from tests.window.conftest import ROOT


@pytest.fixture(scope="module")
def report(blender):
    scene = ROOT / "blend_scenes" / "02_model_on_ground_small.blend"
    shutil.copy(scene, blender.folder / "scene.blend")
    result = blender.play("showing_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_colours_are_there_long_before_the_bake_is_done(report):
    watched = report["first"]
    first = watched["pictures"][0]
    assert watched["said"].startswith("Baked ")
    assert first["at"] < 0.6 * watched["seconds"] and first["known"] < 50
    assert first["off"] < 0.1 and first["error"] < 0.3


def test_the_light_can_be_turned_meanwhile(report):
    pictures = report["turned"]["pictures"]
    assert any(picture["draft"] for picture in pictures)
    # Under the light that the bake ends with.
    assert pictures[-1]["off"] < 0.1 < pictures[0]["off"]


@pytest.mark.parametrize("step", ["over a bake", "over nothing"])
def test_esc_leaves_what_was_there(report, step):
    left = report[f"escaped {step}"]
    assert left["shown"] == ["ground", "model"] and left["same"] and left["materials"]
    assert "colours are as before" in left["said"]
