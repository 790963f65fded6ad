"""What is kept outlives the preview, in a real window (see inside/keep_story.py)."""

import pytest

REALISED = {"left", "right", "group/part", "linked", "fine"}


@pytest.fixture(scope="module")
def report(blender):
    result = blender.play("keep_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert result["error"] is None, result["error"] + result["said_all"]
    return result


@pytest.mark.parametrize(
    ("moment", "preview"),
    [("kept", True), ("restored", False), ("undone", True), ("baked again", True),
     ("reloaded", False)],
)  # fmt: skip
def test_kept_colours_stay_and_nothing_is_there_twice(report, moment, preview):
    seen = report[moment]
    assert seen["same"] == dict.fromkeys(REALISED, True)
    # With the preview its copies are seen, without it what was kept; never the originals.
    assert set(seen["kept visible"]) == set(seen["kept renders"]) == {not preview}
    assert not any(seen["originals visible"]) and not any(seen["originals render"])
    assert seen["materials"] == ["Relit kept colours"]


def test_it_is_said_and_the_second_bake_is_of_the_originals_alone(report):
    assert "5 of them realised in the collection 'PRT Kept'" in report["said"]
    first, second = report["baked objects"]
    assert report["left"] == [] and first == second
    assert {name for name, _ in first} == REALISED | {"floor"}
