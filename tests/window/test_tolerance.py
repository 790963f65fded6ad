"""A missed tolerance is said in the panel, in a real window (see inside/tolerance_story.py)."""


def test_a_missed_tolerance_is_said_after_bake_in_the_list_and_after_load(blender):
    report = blender.play("tolerance_story")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert report["error"] is None, report["error"] + report["said_all"]
    baked = report["baked"]
    assert baked["met"] is False and baked["error"] > 0.001
    missed = baked["notes"][0]
    assert missed.startswith(f"the bounces may be {baked['error']:.2%} off in relit colours")
    assert "more than the tolerance of 0.10%" in missed
    assert baked["message"].startswith("Baked")
    assert report["restored"]["notes"] == [""]
    assert report["loaded"]["message"] == "room_Scene.prt loaded"
    assert report["loaded"]["notes"][0] == missed
    for moment in ("baked", "restored", "loaded"):
        assert report[moment]["listed"]["room_Scene"][0] == missed
