"""Gloss in a real window (see inside/gloss_story.py)."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def report(blender):
    result = blender.play("gloss_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


def test_nothing_of_gloss_goes_wrong(report):
    lines = report["said_all"].splitlines()
    ours = [line for line in lines if 'File "' in line and ("prt_" in line or "/play.py" in line)]
    assert not ours, report["said_all"]
    assert report["grey"] == "No bake is shown" and report["left"] == []


STEPS = ["baked", "orbited", "turned", "off", "on", "camera", "camera moved"]


def test_colours_are_those_of_the_core_for_each_view(report):
    assert list(report["steps"]) == STEPS
    for step, found in report["steps"].items():
        # Another Python and another numpy, but the same arithmetic.
        assert found["difference"] < 1e-5 and not found["failed"], (step, found)
        assert min(np.ravel(list(found["mean"].values()))) > 0, step


def test_every_view_has_colours_of_its_own(report):
    means = {step: str(found["mean"]) for step, found in report["steps"].items()}
    assert means["turned"] == means["on"] and len(set(means.values())) == len(STEPS) - 1
    assert report["changed"] > 0.1


def test_colours_follow_a_view_that_turns_and_the_light_stays(report):
    turning = report["turning"]
    seconds, every = np.transpose(turning["frames"])
    print(
        f"{report['points']:,} points: {len(seconds)} views in {turning['seconds']:.1f} s; ours "
        f"{1e3 * np.median(seconds):.0f} ms, at best {1e3 * seconds.min():.0f} ms, of one of "
        f"{every.astype(int).tolist()} points; with drawing "
        f"{1 / np.median(turning['waits']):.1f} a second"
    )
    assert len(seconds) >= 16 and turning["lights"] == 0
    # Blender draws by software on the same cores meanwhile.
    assert np.quantile(seconds, 0.1) < 0.5
    assert 1 <= turning["fast"] <= 22, "views do not queue"
