"""An artist's days, each from an empty window to a picture (see inside/workflow_story.py)."""

import pytest

STORIES = ("default_cube", "textured_asset", "shared_meshes", "instances", "linked_library",
           "armature", "room", "animated_sun", "gltf", "keep")  # fmt: skip


@pytest.mark.parametrize("story", STORIES)
def test_a_workflow(blender, story):
    import json
    import time

    t = time.time()
    report = blender.play(f"workflow_story:{story}")
    said = report.pop("said_all")
    print(story, f"{time.time() - t:.0f} s", json.dumps(report, indent=1)[:6000])
    (blender.folder / f"{story}.json").write_text(json.dumps(report, indent=1))
    (blender.folder / f"{story}.log").write_text(said)
    assert report["error"] is None, report["error"] + said[-3000:]
