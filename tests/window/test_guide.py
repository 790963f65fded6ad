"""Who follows the artist's guide ends with its picture (see inside/guide_story.py)."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def report(blender):
    result = blender.play("guide_story", size=(1440, 810))
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_what_the_guide_says_is_there(report):
    assert report["said"].startswith("Baked ") and not report["failed"]
    assert report["objects"] == ["Grid", "Suzanne"]
    assert report["turned"] == pytest.approx(90)
    assert report["difference"] < 1e-5


def test_copies_wear_own_materials_and_views_reflect_the_light_of_the_panel(report):
    assert list(report["copies"].values()) == [["Material.001 relit"]]
    world, lights, name, turned = report["reflects"]
    assert (world, lights, name) == (False, True, "city.exr")
    assert turned == pytest.approx(-np.pi / 2, abs=1e-5)
    there, other_way = report["sun"]
    assert there > 0.9 and there > other_way + 0.1, report["sun"]
    assert report["reflects again"] != report["reflects"] and not report["left"]
