"""The scenes that `prt bench` knows by name."""

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.blender import measuring
from prt_core.cli.bench_scenes import scene_named


@pytest.fixture(autouse=True)
def nothing_kept(monkeypatch, tmp_path):
    monkeypatch.setattr(measuring, "CACHE", tmp_path)
    monkeypatch.setattr(measuring, "data_folder", lambda: None)


def test_a_model_stands_on_its_ground():
    scene = measuring.measuring_scene("suzanne", ground=5, levels=0)
    assert [item.name for item in scene.objects] == ["model", "ground"]
    vertices, _ = measuring.model_arrays("suzanne", 0)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    np.testing.assert_allclose(low[2], 0, atol=1e-6)
    np.testing.assert_allclose(high[2], measuring.HEIGHT, atol=1e-6)
    np.testing.assert_allclose((low + high)[:2], 0, atol=1e-6)
    seen = scene.points.object_index[scene.points.visible]
    assert (seen == 1).sum() == 25


def test_names_that_are_none_and_models_that_are_not_here(tmp_path):
    with pytest.raises(PRTError, match="nobody: expected a .blend file or one of bunny, dancer"):
        scene_named("nobody")
    with pytest.raises(PRTError, match="dragon: expected a folder with meshes/.*PRT_DATA"):
        scene_named("dragon")
    assert not list(tmp_path.rglob("*.npz"))
