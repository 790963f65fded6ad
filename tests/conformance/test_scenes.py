"""A sixth of the conformance scenes, and what every golden file must be.

`make conformance` runs all scenes.
"""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("bpy")

from tests.conformance import run  # noqa: E402
from tests.conformance.golden import FOLDER, error, read_golden  # noqa: E402
from tests.conformance.scene import all_scenes  # noqa: E402

SCENES = all_scenes()
# Every other one of the quick ones: all kinds are among them.
QUICK = [scene for scene in SCENES if scene.quick][::2]


@pytest.mark.parametrize("scene", QUICK, ids=lambda scene: f"{scene.kind}/{scene.name}")
def test_a_bake_is_as_cycles_bakes_or_says_why_not(scene, tmp_path):
    if not scene.exists_here:
        pytest.skip("this Blender does not have the feature")
    outcome = run.run_scene(scene, tmp_path)
    assert outcome.verdict in ("right", "said"), outcome.text


def test_a_sixth_of_the_scenes_is_tried_here():
    assert len(SCENES) >= 80
    assert len(QUICK) >= len(SCENES) // 6
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


def test_the_error_leaves_out_the_worst_corners_and_is_a_value_in_the_dark():
    truth = np.full((100, 3), 0.5)
    colours = truth.copy()
    colours[:5] = 9
    assert error(colours, truth) == 0
    colours[5] = 9
    assert error(colours, truth) == pytest.approx(8.5 / 5)
    assert error(np.full((100, 3), 0.2), np.zeros((100, 3))) == pytest.approx(0.2)


@pytest.mark.parametrize(
    "radiance, messages, verdict",
    [
        (0.5, [], "right"),
        (0.7, ["wall: its gloss is left out"], "said"),
        (0.7, ["gloss is left out", "wall: two-sided"], "WRONG"),
        (0.7, [], "WRONG"),
    ],
)
def test_one_message_must_hold_all_the_words(radiance, messages, verdict):
    scene = SimpleNamespace(targets=("wall",), bound=0.03, says=("Wall", "gloss"))
    truth = {"wall": np.full((7, 3), 0.5)}
    colours = {"wall": np.full((7, 3), radiance)}
    assert run.compared(scene, colours, truth, {"without": 1.0}, messages).verdict == verdict


def test_a_scene_that_may_say_nothing_is_wrong_whatever_is_said():
    scene = SimpleNamespace(targets=("wall",), bound=0.03, says=())
    truth, colours = {"wall": np.full((7, 3), 0.5)}, {"wall": np.full((7, 3), 0.7)}
    assert run.compared(scene, colours, truth, {"without": 1.0}, ["wall"]).verdict == "WRONG"
