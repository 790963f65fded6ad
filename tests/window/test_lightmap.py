"""A lightmap in a real window (see inside/lightmap_story.py)."""

import pytest


@pytest.fixture(scope="module")
def report(blender):
    result = blender.play("lightmap_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_objects_wear_it_and_the_scene_is_as_it_was(report):
    assert report["mode"] == ["OBJECT", "OBJECT"] and report["same selection"]
    assert report["scenes"] == 0
    maps = report["maps"]
    assert "PRT Lightmap" in maps["floor"] and "PRT Lightmap" not in maps["fine"]
    kept = [layers for name, layers in maps.items() if "kept" in name]
    assert len(kept) == 3 and all("PRT Lightmap" in layers for layers in kept)


def test_the_image_is_loaded(report):
    assert report["said"].startswith("Lightmap 'map' of 4 objects")
    space, width, height, mean = report["image"]
    assert (space, width, height) == ("sRGB", 128, 128) and 0.05 < mean < 1


def test_occlusion_is_an_attribute_beside_the_preview(report):
    assert {"AO", "PRT"} <= set(report["attributes"])
