"""Where meshes were refined is kept with a bake, and checked when it is read."""

import shutil

import numpy as np
import pytest

from prt_core import BakeSettings, PRTError, Scene, bake_steps, load, run
from prt_core.evaluate.refined_picture import refined_picture
from prt_core.scene import Camera, SplitMeshes
from tests.core.store.conftest import forge_array
from tests.meshes import caster_of, plane


@pytest.fixture(scope="module")
def meshes():
    """A floor of eight triangles, one of which was split twice, and one that stayed."""
    state = SplitMeshes([plane(3, name="floor"), plane(2, 2, 3, name="other")])
    for _ in range(2):
        state.split(np.arange(state.n_edges) == state.edges[0, 1])
    return state.meshes()


@pytest.fixture(scope="module")
def baked(meshes, tmp_path_factory):
    path = tmp_path_factory.mktemp("refined") / "a.prt"
    run(bake_steps(Scene.from_meshes(meshes, max_hidden=0), path, BakeSettings(2, bounces=0)))
    return path


def test_it_is_read_as_it_was(baked, meshes):
    bake = load(baked)
    first, second = bake.scene.objects
    assert bake.report["refined"] == {"floor": int((first.refined.vertex_round > 0).sum())}
    assert second.refined is None
    for name in ("around", "weights", "vertex_round", "n_before"):
        np.testing.assert_array_equal(
            getattr(first.refined, name), getattr(meshes[0].refined, name), err_msg=name
        )
    assert first.refined.vertex_round.max() == 2 and first.refined.n_before == 16


@pytest.mark.parametrize("name, value", [("around", 99), ("around", -1), ("weights", 3.0)])
def test_numbers_that_lead_nowhere_are_refused(baked, tmp_path, name, value):
    path = tmp_path / "b.prt"
    shutil.copytree(baked, path)
    forge_array(path, f"refined_{name}", lambda values: np.full_like(values, value))
    with pytest.raises(PRTError, match="refined is out of range"):
        load(path)


def test_its_picture_shows_the_rounds(baked):
    scene = load(baked).scene
    above = np.eye(4)
    above[:3, 3] = 0, 0, 2.5
    picture = refined_picture(scene, caster_of(scene), Camera(above, 0.5), 200, 160)
    grey = (np.ptp(picture.astype(int), axis=2) == 0).mean()
    assert 0.5 < grey < 0.95
    # Lines between grey faces are dark, so the reddest is that of a face.
    assert (picture == 92).all(axis=2).mean() > 0.005
    red = picture[..., 0].astype(int) - picture[..., 1]
    assert red.max() > 100 and (red > 100).mean() < 0.2


def test_a_bake_without_refined_meshes_has_no_such_picture():
    scene = Scene.from_meshes([plane(2)])
    with pytest.raises(PRTError, match="bake with --refine"):
        refined_picture(scene, caster_of(scene))
