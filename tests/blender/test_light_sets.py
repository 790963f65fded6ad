"""Lights that are kept by name in the panel: blended, switched, keyed, kept and exported."""

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import preview
from prt_core.blender.compat import fcurve_of
from prt_core.cli import main
from tests.blender.conftest import colours_on


@pytest.fixture
def lit(baked_floor):
    """A scene with two sets: its world, and a studio light with a lamp."""
    lamp = bpy.data.objects.new("Desk", bpy.data.lights.new("Desk", "POINT"))
    lamp.location, lamp.data.energy = (0.5, 0.5, 1.5), 50
    baked_floor.collection.objects.link(lamp)
    baked_floor.prt.use_lamps = False
    for _ in range(2):
        assert bpy.ops.prt.light_set_add() == {"FINISHED"}
    day, night = baked_floor.prt.sets
    day.name, night.name = "Day", "Night"
    night.light, night.use_lamps, night.lamp_samples = "STUDIO", True, 4
    return baked_floor


def relit():
    bpy.ops.prt.relight()
    return colours_on("ball").copy()


def alone(index):
    bpy.ops.prt.light_set_only(index=index)
    return relit()


def test_the_first_set_is_the_light_of_the_panel(baked_floor):
    before = relit()
    bpy.ops.prt.light_set_add()
    assert (relit() == before).all()
    bpy.ops.prt.light_set_remove()
    assert not baked_floor.prt.sets and (relit() == before).all()


def test_weights_blend_and_follow_the_timeline(lit):
    sets, (day, night) = lit.prt.sets, (alone(0), alone(1))
    assert not np.allclose(day, night)
    for frame, weights in ((1, (1.0, 0.0)), (11, (0.5, 1.0))):
        lit.frame_set(frame)
        for each, weight in zip(sets, weights, strict=True):
            each.weight = weight
        assert bpy.ops.prt.light_set_key() == {"FINISHED"}
    for index in range(2):
        for key in fcurve_of(lit, f"prt.sets[{index}].weight").keyframe_points:
            key.interpolation = "LINEAR"
    for frame, weights in ((1, (1.0, 0.0)), (6, (0.75, 0.5)), (11, (0.5, 1.0))):
        lit.frame_set(frame)
        wanted = weights[0] * day + weights[1] * night
        np.testing.assert_allclose(colours_on("ball"), wanted, rtol=1e-4, atol=1e-6)


def test_keys_stay_with_their_lights_when_one_is_forgotten(lit):
    bpy.ops.prt.light_set_add()
    sets = lit.prt.sets
    sets[1].driver_add("rotation")
    for frame, weights in ((1, (0.0, 0.25, 1.0)), (11, (1.0, 0.5, 0.0))):
        lit.frame_set(frame)
        for each, weight in zip(sets, weights, strict=True):
            each.weight = weight
        bpy.ops.prt.light_set_key()
    kept = [each.name for each in sets][1:]
    lit.prt.active_set = 0
    assert bpy.ops.prt.light_set_remove() == {"FINISHED"}
    assert [each.name for each in sets] == kept
    for frame, weights in ((1, (0.25, 1.0)), (11, (0.5, 0.0))):
        lit.frame_set(frame)
        assert [each.weight for each in sets] == list(weights)
    assert fcurve_of(lit, "prt.sets[2].weight") is None
    assert [each.data_path for each in lit.animation_data.drivers] == ["prt.sets[0].rotation"]


def test_lamps_of_a_set_are_its_own(lit):
    with_lamp = alone(1)
    desk = lit.prt.sets[1].lamps["Desk"]
    desk.strength = 0.0
    without = relit()
    desk.strength = 2.0
    np.testing.assert_allclose(relit() - without, 2 * (with_lamp - without), rtol=1e-3, atol=1e-5)


def test_names_stay_apart(lit):
    lit.prt.sets[1].name = "Day"
    assert [each.name for each in lit.prt.sets] == ["Day", "Day 2"]


def test_each_light_is_kept_and_exported(lit, tmp_path):
    day, night = alone(0), alone(1)
    assert bpy.ops.prt.keep(attribute="Kept", each_light=True) == {"FINISHED"}
    assert (colours_on("ball", "Kept Day") == day).all()
    assert (colours_on("ball", "Kept Night") == night).all()
    path = str(tmp_path / "out_##.npz")
    bpy.ops.prt.export(filepath=path, use_scene_range=False, first=3, last=3, each_light=True)
    assert (np.load(tmp_path / "out_Night_03.npz")["ball"] == night).all()
    lit.prt.sets[1].name = "DAY"
    with pytest.raises(RuntimeError, match="of two lights, 'Day' and 'DAY'; rename one"):
        bpy.ops.prt.export(filepath=path, each_light=True)
    lit.prt.sets[1].name = "Night"
    # The command line reads what the panel writes.
    lights, there = tmp_path / "lights.json", str(tmp_path / "cli.npz")
    assert bpy.ops.prt.export_lights(filepath=str(lights)) == {"FINISHED"}
    bake = prt_core.load(preview.path_of(lit))
    if not bake.lamps:
        lit.prt.sets[1].use_lamps = False
        bpy.ops.prt.export_lights(filepath=str(lights))
        night = relit()
    asked = ["relight", str(bake.path), "--lights", str(lights), "--weights", "Night=1"]
    assert main([*asked, "--output", there, "--caster", "blender"]) == 0
    np.testing.assert_allclose(np.load(there)["ball"], night, rtol=1e-5, atol=1e-6)


def test_buttons_without_a_set_say_why(baked_floor):
    assert not bpy.ops.prt.light_set_only.poll()
    assert not bpy.ops.prt.export_lights.poll()


def test_what_is_wrong_with_a_set_is_said_with_its_name(lit):
    lit.prt.sets[1].light, lit.prt.sets[1].file = "FILE", ""
    for button in (bpy.ops.prt.relight, bpy.ops.prt.export_lights):
        with pytest.raises(RuntimeError, match="light 'Night': choose an .exr or .hdr image"):
            button()


def test_the_chosen_set_is_one_that_is_there(lit):
    lit.prt.active_set = 9
    assert bpy.ops.prt.light_set_add() == {"FINISHED"}
    assert lit.prt.active_set == 2 and lit.prt.sets[2].light == "STUDIO"
    lit.prt.active_set = 9
    assert bpy.ops.prt.light_set_remove() == {"FINISHED"} and lit.prt.active_set == 1
