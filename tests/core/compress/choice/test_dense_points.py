"""Clusters of a sparse bake begin with its dense points, from the store to the form."""

import shutil

import numpy as np
import pytest

from prt_core import BakeSettings, BakeStore, PRTError, Scene, bake_steps, load, run
from prt_core.api import compress, relight_points
from prt_core.bake.measure import standing_lights
from prt_core.compress import Task, method_from_text
from prt_core.sampling import sampler_named
from prt_core.sphere import CubeMap
from tests.meshes import plane, sphere

SKY = standing_lights()["low soft sun"]


@pytest.fixture(scope="module")
def scene():
    ball = sphere(9, 0.5, (0, 0, 0.6), name="ball", albedo=(0.9, 0.3, 0.1))
    return Scene.from_meshes([ball, plane(13, albedo=0.7)], max_hidden=0)


@pytest.fixture(scope="module")
def original(scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("sparse") / "a.prt"
    settings = BakeSettings(resolution=4, tolerance=0.2, method="huang", bounces=0)
    run(bake_steps(scene, path, settings))
    return path


@pytest.fixture
def path(original, tmp_path):
    return shutil.copytree(original, tmp_path / "a.prt")


def test_a_bake_keeps_its_dense_points(scene, original):
    sampler, settings = sampler_named("huang")
    caster = scene.make_caster()
    wanted = run(sampler(scene, CubeMap(4), caster, settings())).dense.points
    caster.close()
    np.testing.assert_array_equal(load(original).dense, wanted)
    assert 0 < len(wanted) < len(scene.points)


def test_other_bakes_have_none(scene, tmp_path):
    run(bake_steps(scene, tmp_path / "b.prt", BakeSettings(resolution=4, bounces=0)))
    assert load(tmp_path / "b.prt").dense is None
    with pytest.raises(PRTError, match="'sparse_cpca' begins with densely .* --method huang"):
        compress(tmp_path / "b.prt", method="sparse_cpca", lights={"sky": SKY})


def test_what_is_no_list_of_points_is_damage(path):
    store = BakeStore(path, "r+")
    dense = store.read("dense")
    store.write("dense", dense[::-1].copy())
    store.array("visibility")
    attributes = store.attributes
    store.update(arrays={**attributes["arrays"], "dense": store.array("dense").digest()})
    with pytest.raises(PRTError, match="'dense' is out of range; the bake is damaged"):
        load(path)


def test_clusters_of_dense_points_serve_all(path):
    bake = load(path)
    task = Task.of(bake.transport, bake.scene.points, 0, bake.dense)
    for model in method_from_text("sparse_cpca:n_components=3").budgets(task):
        near, groups = model.neighbours, bake.scene.points.object_index
        assert np.isin(near[near >= 0], bake.dense).all() and (near[:, 0] >= 0).all()
        assert (groups[near] == groups[:, None])[near >= 0].all()
    # Nearest first: a dense point is its own neighbour.
    places = bake.scene.points.positions
    np.testing.assert_array_equal(places[near[bake.dense, 0]], places[bake.dense])
    subset = np.sort(np.random.default_rng(0).choice(task.n_points, 41, replace=False))
    part = task.some(subset)
    np.testing.assert_array_equal(subset[part.dense], np.intersect1d(subset, bake.dense))
    attributes = compress(path, method="sparse_cpca:n_clusters=5,n_components=7", tolerance=0.3,
                          lights={"sky": SKY})  # fmt: skip
    assert attributes["tolerance_met"] and attributes["settings"]["n_clusters"] == 5
    result = relight_points(load(path), SKY, rotation=65, form="compressed")
    exact = relight_points(load(path), SKY, rotation=65, form="exact")
    assert 0 < np.linalg.norm(result - exact) <= attributes["worst"] * 1.001 * np.linalg.norm(exact)


def test_auto_begins_with_them_where_there_are_any(path):
    attributes = compress(path, tolerance=0.3, lights={"sky": SKY})
    tried = {trial["method"] for trial in attributes["trials"]}
    assert "sparse_cpca" in tried and "cpca" not in tried


def test_a_stopped_bake_that_lost_them_samples_again(scene, original, path):
    store = BakeStore(path, "r+")
    store.update(complete=False)
    store.remove("dense")
    settings = BakeSettings(resolution=4, tolerance=0.2, method="huang", bounces=0)
    run(bake_steps(scene, path, settings))
    np.testing.assert_array_equal(load(path).dense, load(original).dense)
