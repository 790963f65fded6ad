"""From the zip to a picture in few clicks (see inside/first_picture.py)."""


def test_few_clicks_lead_from_the_zip_to_a_picture_like_cycles_own(blender):
    report = blender.play("first_picture")
    print(f"Blender {blender.version}: pictures and report.json in {blender.folder}")
    assert report["error"] is None, report["error"] + report["said_all"]
    print(len(report["clicks"]), report["clicks"], report["keys"], report["waited"])
    print(report["cycles"])
    assert report["said"].startswith("Baked ") and not report["failed"]
    assert len(report["clicks"]) + len(report["keys"]) <= 10
    assert report["cycles"]["l2"] < 0.05, report["cycles"]
    # The cube's own gloss is not baked here, which takes 3 % from what is diffuse.
    assert max(abs(ratio - 1) for ratio in report["cycles"]["ratio"]) < 0.04, report["cycles"]
