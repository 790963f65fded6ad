"""The button that writes a web page does what the call does."""

import bpy
import pytest

import prt_core
from blender_addon import preview

pytestmark = pytest.mark.usefixtures("addon")


def test_the_button_is_the_call(floor_scene, tmp_path):
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.prt.web_page(filepath=str(tmp_path / "early.html"))
    assert bpy.ops.prt.bake() == {"FINISHED"}
    page = tmp_path / "page.html"
    assert bpy.ops.prt.web_page(filepath=str(page), suns="SOFT") == {"FINISHED"}
    same = prt_core.export_web(preview.path_of(floor_scene), tmp_path / "same.html", bits=False)
    assert same["bytes"] == page.stat().st_size
    assert "lights" in same and not (tmp_path / "early.html").exists()


def test_where_the_page_goes(baked_floor):
    assert bpy.ops.prt.web_page(filepath="//page.html") == {"FINISHED"}
    with open(bpy.path.abspath("//page.html"), encoding="utf-8") as file:
        assert file.read(15) == "<!DOCTYPE html>"
    with pytest.raises(RuntimeError, match="scene.blend"):
        bpy.ops.prt.web_page(filepath="//scene.blend/page.html")
    assert bpy.ops.prt.web_page_dialog(filepath="//again.html") == {"FINISHED"}
