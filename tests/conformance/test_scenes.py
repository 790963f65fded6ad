"""A third of the conformance scenes, and what every golden file must be.

`make conformance` runs all scenes.
"""

import pytest

pytest.importorskip("bpy")

from tests.conformance.golden import FOLDER, read_golden  # noqa: E402
from tests.conformance.run import run_scene  # noqa: E402
from tests.conformance.scene import all_scenes  # noqa: E402

SCENES = all_scenes()
QUICK = [scene for scene in SCENES if scene.quick]


@pytest.mark.parametrize("scene", QUICK, ids=lambda scene: f"{scene.kind}/{scene.name}")
def test_a_bake_is_as_cycles_bakes_or_says_why_not(scene, tmp_path):
    if not scene.exists_here:
        pytest.skip("this Blender does not have the feature")
    outcome = run_scene(scene, tmp_path)
    assert outcome.verdict in ("right", "said"), outcome.text


def test_a_third_of_the_scenes_is_tried_here():
    assert len(SCENES) >= 80
    assert len(QUICK) >= len(SCENES) // 3
    assert {scene.kind for scene in QUICK} == {scene.kind for scene in SCENES}


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_no_scene_passes_that_ignores_its_feature(scene):
    colours, made = read_golden(scene.name)
    assert set(colours) == set(scene.targets)
    assert made["without"] >= 2 * scene.bound, "make_golden would have refused it"
    assert made["noise"] <= scene.bound / 2, "make_golden would have refused it"


def test_golden_files_are_small_and_belong_to_scenes():
    files = list(FOLDER.iterdir())
    assert {file.name for file in files} == {f"{scene.name}.npz" for scene in SCENES}
    assert sum(file.stat().st_size for file in files) < 1_500_000
