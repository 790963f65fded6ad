"""Two files of one folder, and undo of a bake, in a real window (see inside/files_story.py)."""

import pytest

FLAT = ["VERTEX", "FLAT"]
BOTH = ["fine", "floor"]


@pytest.fixture(scope="module")
def report(blender):
    result = blender.play("files_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_undo_takes_all_of_a_bake_away_and_redo_brings_it_back(report):
    baked, undone, redone = (report[name] for name in ("baked", "undone", "redone"))
    assert baked["message"].startswith("Baked") and baked["view"] == FLAT
    assert baked["coloured"] == BOTH and baked["loaded"] == "//prt/v01_Scene.prt"
    assert undone["loaded"] == "" and undone["coloured"] == [] and undone["view"] != FLAT
    assert undone["message"] == "The preview is undone; its bake stays on the disk"
    assert redone["coloured"] == BOTH and redone["view"] == FLAT and redone["message"] == ""
    assert redone["loaded"] == baked["loaded"] and redone["finite"]


def test_each_file_has_its_bake(report):
    assert report["saved as"]["loaded"] == "//prt/v01_Scene.prt"
    assert "(fine changed); bake again" in report["moved"]["warned"]
    assert report["second"]["loaded"] == "//prt/v02_Scene.prt" and not report["second"]["warned"]
    assert report["second"]["selected"] == "v02_Scene"
    for moment, name in (("opened", "v01_Scene"), ("second again", "v02_Scene")):
        seen = report[moment]
        assert seen["loaded"] == f"//prt/{name}.prt" and seen["selected"] == name
        assert seen["message"] == seen["warned"] == "" and seen["coloured"] == BOTH
    assert report["same"], "the first file has its own shadows"


def test_a_bake_of_another_scene_is_said(report):
    assert "is not the one that was baked (fine changed)" in report["of another"]["warned"]
    assert report["restored"]["coloured"] == [] and report["restored"]["warned"] == ""


def test_nothing_is_left_in_a_new_file(report):
    new = report["new"]
    assert new["message"] == new["warned"] == new["loaded"] == "" and new["view"] != FLAT
