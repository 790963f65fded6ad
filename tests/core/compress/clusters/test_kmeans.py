import numpy as np
import pytest
from sklearn.cluster import KMeans

from prt_core.compress.clusters.kmeans import kmeans_steps
from prt_core.runtime.progress import run

RNG = np.random.default_rng(2)


def spread(points, labels):
    """Sum of squared distances to the clusters' means."""
    means = [points[labels == k].mean(axis=0) for k in np.unique(labels)]
    index = np.unique(labels, return_inverse=True)[1]
    return float(((points - np.array(means)[index]) ** 2).sum())


def test_blobs_are_found():
    centres = RNG.normal(size=(12, 6)) * 30
    truth = RNG.integers(0, 12, 5000)
    points = (centres[truth] + RNG.normal(size=(5000, 6))).astype(np.float32)
    labels = run(kmeans_steps(points, 12, seed=1))
    assert spread(points, labels) < 1.5 * spread(points, truth)


def test_it_is_as_good_as_a_library():
    points = RNG.normal(size=(3000, 8)).astype(np.float32)
    theirs = KMeans(40, n_init=1, random_state=0).fit_predict(points)
    labels = run(kmeans_steps(points, 40))
    assert labels.dtype == np.int32 and labels.max() < 40
    assert spread(points, labels) < 1.03 * spread(points, theirs)


def test_the_same_seed_gives_the_same_labels_on_any_number_of_cores(monkeypatch):
    points = RNG.normal(size=(9000, 16)).astype(np.float32)
    one = run(kmeans_steps(points, 100, seed=3))
    monkeypatch.setenv("PRT_THREADS", "1")
    np.testing.assert_array_equal(run(kmeans_steps(points, 100, seed=3)), one)


@pytest.mark.parametrize("n", [2, 50])
def test_points_that_coincide_share_clusters(n):
    points = np.repeat(RNG.normal(size=(n, 3)), 20, axis=0).astype(np.float32)
    labels = run(kmeans_steps(points, 30)).reshape(n, 20)
    assert (labels == labels[:, :1]).all()
    assert len(np.unique(labels[:, 0])) >= min(n, 20)


def test_ends():
    points = RNG.normal(size=(7, 2)).astype(np.float32)
    assert (run(kmeans_steps(points, 1)) == 0).all()
    assert sorted(run(kmeans_steps(points, 9))) == list(range(7))
    assert (run(kmeans_steps(np.zeros((5, 0), np.float32), 3)) == 0).all()
    far = points * 1e-3 + np.float32(1e3)
    assert len(np.unique(run(kmeans_steps(far, 3)))) >= 1
