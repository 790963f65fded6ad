"""Light fields in a real window (see inside/light_field_story.py)."""

import numpy as np
import pytest

FIELD, BAKE = ["PRT Light Field"], ["PRT"]


@pytest.fixture(scope="module")
def report(blender):
    result = blender.play("light_field_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_nothing_of_ours_goes_wrong(report):
    lines = report["said_all"].splitlines()
    ours = [line for line in lines if 'File "' in line and ("prt_" in line or "/play.py" in line)]
    assert not ours, report["said_all"]


def test_colours_are_those_of_the_api_after_every_step(report):
    expected = {"baked", "orbited"}
    if report["new"]:
        expected |= {"dragged", "dimmed", "undone", "reloaded"}
    assert set(report["steps"]) == expected
    for step, found in report["steps"].items():
        assert found["difference"] < 1e-3 and not found["failed"], (step, found)
        assert max(found["mean"]) > 0, step
        assert found["attributes"]["ball"] == FIELD, step


def test_colours_follow_an_orbit(report):
    orbit = report["orbit"]
    frames, steps = np.array(orbit["frames"]), np.array(orbit["steps"])
    assert len(frames) >= len(steps) and len(steps) == 40
    ours = frames.sum(axis=1)
    print(
        f"{orbit['points']:,} points, {orbit['kind']}: look-up, writing, evaluation (ms) "
        f"{np.round(1e3 * np.median(frames, axis=0), 1)}, all {1e3 * np.median(ours):.1f}, "
        f"{1 / np.median(ours):.0f} a second; with drawing {1 / np.median(steps):.1f} a second"
    )
    # Other processes share the cores: the better half of the frames.
    assert np.quantile(ours, 0.25) < 1 / 15
    assert not report["new"] or orbit["changed"] > 0.01


def test_lamps_are_dimmed_without_new_tables(report):
    if report["new"]:
        assert report["same_tables"] and report["dragged"] < 1
        means = {step: found["mean"] for step, found in report["steps"].items()}
        assert means["orbited"] != means["dragged"] != means["dimmed"]
        assert max(means["dimmed"]) < max(means["orbited"])


def test_it_is_shown_beside_relit_objects_and_given_back(report):
    assert report["beside"] == {"ball": FIELD if report["new"] else BAKE, "floor": BAKE}
    assert report["left"] == {"ball": BAKE, "floor": BAKE}


def test_what_moved_is_said_until_it_is_back(report):
    if report["new"]:
        assert "ball changed since" in report["moved"] and report["back"] == ""
