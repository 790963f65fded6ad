"""What Material Preview reflects while own materials are shown, and what it gets back."""

import math
from pathlib import Path

import bpy
import pytest

from blender_addon import reflections, views

pytestmark = pytest.mark.usefixtures("addon")


@pytest.fixture
def shading():
    """Of the one view, in Material Preview."""
    (view,) = {key: shading for _, key, shading in views.of_windows()}.values()
    before = view.type
    view.type = "MATERIAL"
    view.use_scene_world, view.use_scene_lights = False, False
    view.studio_light, view.studiolight_rotate_z, view.studiolight_intensity = "forest.exr", 0.5, 2
    yield view
    reflections.restore()
    view.type = before


def seen(shading):
    return [getattr(shading, name) for name in reflections._NAMES]


def test_views_reflect_the_light_of_the_panel_and_get_theirs_back(baked_floor, shading):
    before, chosen = seen(shading), baked_floor.prt
    reflections.follow(baked_floor)
    assert seen(shading) == before, "colours have no reflections"
    chosen.look = "MATERIALS"
    reflections.follow(baked_floor)
    assert shading.use_scene_world and shading.use_scene_lights == chosen.use_lamps
    chosen.light, chosen.studio, chosen.rotation, chosen.strength = "STUDIO", "city.exr", 4.0, 0.5
    chosen.exposure = 2
    reflections.follow(baked_floor)
    assert not shading.use_scene_world and shading.studio_light == "city.exr"
    assert shading.studiolight_rotate_z == pytest.approx(2 * math.pi - 4.0)
    assert shading.studiolight_intensity == pytest.approx(2.0)
    # What a person changes stays until the light does.
    shading.studiolight_intensity = 1
    reflections.follow(baked_floor)
    assert shading.studiolight_intensity == 1
    # Another file's views are told anew, though their screens have the same names.
    reflections.another_file()
    reflections.follow(baked_floor)
    assert shading.studiolight_intensity == pytest.approx(2.0)
    shading.type = "SOLID"
    chosen.look = "COLOURS"
    reflections.follow(baked_floor)
    shading.type = "MATERIAL"
    reflections.follow(baked_floor)
    assert seen(shading) == before


def test_an_image_is_added_for_the_session(baked_floor, shading, tmp_path):
    lights = bpy.context.preferences.studio_lights
    city = next(light.path for light in lights if light.name == "city.exr")
    path = tmp_path / "mine.exr"
    path.write_bytes(Path(city).read_bytes())
    baked_floor.prt.look, baked_floor.prt.light = "MATERIALS", "FILE"
    before = seen(shading)
    baked_floor.prt.file = str(tmp_path / "missing.hdr.txt")
    reflections.follow(baked_floor)
    assert seen(shading) == before
    baked_floor.prt.file = str(path)
    reflections.follow(baked_floor)
    assert shading.studio_light == "mine.exr"
    count = len(lights)
    baked_floor.prt.rotation = 1.0
    reflections.follow(baked_floor)
    assert len(lights) == count and shading.studiolight_rotate_z == pytest.approx(-1.0)
    bpy.ops.prt.clear()
    reflections.follow(baked_floor)
    assert seen(shading) == before
    lights.remove(lights["mine.exr"])
