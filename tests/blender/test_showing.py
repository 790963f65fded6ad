"""Colours while a bake runs, as the timer of a window would write them."""

import time

import bpy
import numpy as np
import pytest

import prt_core
from blender_addon import operators, plan, preview, showing, views, work
from prt_core.api import bake_blend_steps
from prt_core.bake import BakeSettings
from prt_core.runtime.progress import run
from tests.blender.conftest import colours_on

SETTINGS = BakeSettings(resolution=8, tolerance=0.05, caster="blender", method="agreement")


class Baking:
    """A bake of the open scene beside which the timer works."""

    def __init__(self, scene, path):
        self.touched = time.perf_counter()
        self.steps = bake_blend_steps(
            None, path, SETTINGS, pace=0.01, scene=scene, pictures=showing.begin(scene)
        )

    def until(self, condition=lambda: False):
        """Whether it holds before the bake ends."""
        for _ in self.steps:
            showing.tick(self.touched)
            if condition():
                return True
        return False

    def turn(self, scene):
        scene.prt.rotation += 1.0
        self.touched = time.perf_counter()


@pytest.fixture
def baking(floor_scene, tmp_path):
    floor_scene.prt.light, floor_scene.prt.studio = "STUDIO", "sunset.exr"
    baking = Baking(floor_scene, tmp_path / "b.prt")
    yield baking
    baking.steps.close()
    showing.end(True)


def test_colours_come_while_it_runs_and_are_near_the_last(baking, floor_scene, tmp_path, hdri):
    assert showing.awaits_first()
    assert baking.until(lambda: showing.delays)
    assert not showing.awaits_first()
    first = colours_on("ball")
    assert views.shown() and not floor_scene.prt.loaded and preview.held() is None
    assert "Shown from" in work.status().message and not work.status().failed
    baking.until()
    bake = prt_core.load(tmp_path / "b.prt")
    final = prt_core.relight(bake, hdri("sunset"))["ball"]
    assert np.abs(first - final).mean() < 0.15 * final.mean()
    _, _, known, error, turned = showing.delays[0]
    assert 0 < known < 100 and 0.01 < error < 0.5 and not turned


def test_the_light_is_turned_meanwhile(baking, floor_scene):
    assert baking.until(lambda: showing.delays)
    before = colours_on("floor")
    baking.turn(floor_scene)
    assert baking.until(lambda: any(turned for *_, turned in showing.delays))
    assert np.abs(colours_on("floor") - before).mean() > 0.02 * before.mean()


def test_what_was_there_comes_back(baking, floor_scene):
    slots = [slot.material for slot in bpy.data.objects["ball"].material_slots]
    assert baking.until(lambda: showing.delays)
    assert "PRT" in bpy.data.objects["ball"].data.color_attributes
    baking.steps.close()
    showing.end(False)
    assert "PRT" not in bpy.data.objects["ball"].data.color_attributes
    assert [slot.material for slot in bpy.data.objects["ball"].material_slots] == slots
    assert not views.shown() and not preview.present(floor_scene)
    assert showing.tick(time.perf_counter()) is None


def test_so_do_the_colours_of_another_bake(baked_floor, tmp_path):
    before = colours_on("ball")
    baking = Baking(baked_floor, tmp_path / "other.prt")
    baked_floor.prt.rotation += 1.0
    assert baking.until(lambda: showing.delays)
    assert (colours_on("ball") != before).any()
    baking.steps.close()
    showing.end(False)
    np.testing.assert_array_equal(colours_on("ball"), before)
    assert views.shown() and preview.held(baked_floor) is not None


def test_a_light_that_is_wrong_is_said_and_the_bake_goes_on(baking, floor_scene, tmp_path):
    floor_scene.prt.light, floor_scene.prt.file = "FILE", "//nowhere.exr"
    assert not baking.until(lambda: showing.delays)
    assert "nowhere.exr" in work.status().message
    assert prt_core.load(tmp_path / "b.prt").report["tolerance_met"]


def test_an_object_that_went_ends_no_bake(baking, tmp_path):
    assert baking.until(lambda: showing.delays)
    bpy.data.objects.remove(bpy.data.objects["ball"])
    baking.turn(bpy.context.scene)
    baking.until()
    assert prt_core.load(tmp_path / "b.prt").report["tolerance_met"]
    showing.end(False)


def test_emitters_of_another_bake_are_not_asked_for(baking, floor_scene):
    item = floor_scene.prt.emitters.add()
    item.name, item.strength = "Lamp of another file", 3.0
    assert baking.until(lambda: showing.delays)


def test_a_scene_that_the_panel_has_read_is_known(floor_scene):
    assert plan.built(floor_scene) == (None, None)
    run(plan.steps(floor_scene))
    built, digests = plan.built(floor_scene)
    assert len(built.points) > 100 and set(digests) == {"ball", "floor"}
    plan.outdate(floor_scene, geometry=False)
    assert plan.built(floor_scene) == (None, None)
    run(plan.steps(floor_scene))
    assert plan.built(floor_scene)[0] is not None
    # Read anew by something else, with a change that the plan has not seen.
    bpy.data.objects["ball"].location.x += 0.1
    run(plan.read_steps(floor_scene))
    assert plan.built(floor_scene) == (None, None)


@pytest.mark.parametrize("is_known", [False, True])
def test_the_button_shows_colours_and_esc_takes_them_back(floor_scene, is_known):
    names = "title", "steps", "_bake_steps", "stopped", "finish"
    own = {name: getattr(operators.PRT_OT_bake, name) for name in names}
    own |= {"restart": True, "update": False, "only": None, "report": lambda *_: None}
    button = type("Bake", (work.LongWork,), own)()
    if is_known:
        run(plan.steps(floor_scene))
    steps, stages = button.steps(bpy.context, 0.01), []
    for progress in steps:
        stages.append(progress.stage)
        showing.tick(0.0)
        if showing.delays:
            break
    assert "PRT" in bpy.data.objects["ball"].data.color_attributes
    # What the panel has read is shown before it is read once more.
    assert ("evaluate" in stages) != is_known and ("first look" in stages) == is_known
    steps.close()
    assert "PRT" not in bpy.data.objects["ball"].data.color_attributes
    steps = button.steps(bpy.context, 0.01)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            button.finish(bpy.context, end.value)
            break
        showing.tick(0.0)
    held = preview.held(floor_scene)
    np.testing.assert_array_equal(colours_on("ball"), held.bake.colours(held.radiance)["ball"])
    assert work.status().message.startswith("Baked") and not showing.awaits_first()
