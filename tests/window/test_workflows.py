"""An artist's days, each from an empty window to a picture (see inside/workflow_story.py).

An image by UV is in test_lightmap.py.
"""

import pytest

# How far a picture may be from Cycles' own of the scene, where vertices are too few for textures
# and for the edges of shadows; and the means of its channels.
_APART, _MEANS = 0.12, 0.04
STORIES = {
    "default_cube": ["Cube"],
    "six_materials": ["chrome", "floor", "glass", "gold", "lacquer", "tube", "wall"],
    "textured_asset": ["crate", "floor"],
    "shared_meshes": ["floor", "pillar", *(f"pillar {n}" for n in range(1, 6))],
    "instances": ["floor", *(f"tree {n}/{part}" for n in range(7) for part in ("crown", "trunk"))],
    "linked_library": ["bust", "floor", "plinth"],
    "armature": ["arm", "floor"],
    "room": ["back", "ball", "ceiling", "front", "ground", "lintel", "pier", "pier 2", "right",
             "sill"],
    "animated_sun": ["floor", "rod"],
}  # fmt: skip


def play(blender, story):
    report = blender.play(f"workflow_story:{story}")
    print(f"Blender {blender.version}, {story}: {report['seconds']:.0f} s, {report.get('cycles')}")
    assert report["error"] is None, report["error"] + report["said_all"]
    lines = report["said_all"].splitlines()
    ours = [line for line in lines if 'File "' in line and ("prt_" in line or "/play.py" in line)]
    assert not ours, report["said_all"]
    for step, found in report["core"].items():
        assert found["same objects"] and found["difference"] < 1e-5, (step, found)
        said = report["said"][step]
        assert not said["failed"] and not said["warned"] and said["burnt"] < 0.05, (step, said)
    return report


@pytest.mark.parametrize("story", STORIES)
def test_a_picture_is_that_of_the_core_and_near_cycles(blender, story):
    report = play(blender, story)
    first = next(iter(report["core"].values()))
    assert set(first["mean"]) == set(STORIES[story])
    # Glass is taken for thin, and vertices are too few for what chrome mirrors.
    apart = 3 * _APART if story == "six_materials" else _APART
    assert report["cycles"]["l2"] < apart, report["cycles"]
    assert max(abs(ratio - 1) for ratio in report["cycles"]["ratio"]) < _MEANS, report["cycles"]
    if "own materials" in report:
        assert report["own materials"]["l2"] < 2 * _APART, report["own materials"]
        assert report["as before"]
    if story == "armature":
        assert "changed" in report["warned"]
        steps = [str(found["mean"]) for found in report["core"].values()]
        assert steps[0] == steps[1] != steps[2]
    if story == "animated_sun":
        assert report["played"] >= 3
        assert len({str(found["mean"]) for found in report["core"].values()}) == 3


def test_gltf_comes_back(blender):
    report = play(blender, "gltf")
    assert set(report["back"]) == {"crate", "floor"}
    for name, found in report["back"].items():
        assert "_PRT_RADIANCE" in found["layers"] and found["colours"], (name, found)
        assert found["largest"] == pytest.approx(found["went out"], rel=1e-5)


def test_kept_colours_render_as_cycles_has_the_scene(blender):
    report = play(blender, "keep")
    assert set(report["active"].values()) == {"Relit"}
    for engine, found in report["engines"].items():
        assert found["l2"] < _APART, (engine, found)
        assert max(abs(ratio - 1) for ratio in found["ratio"]) < _MEANS, (engine, found)
