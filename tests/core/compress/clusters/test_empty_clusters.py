import numpy as np
import pytest

from prt_core.compress.clusters.kmeans import kmeans_steps
from prt_core.runtime.progress import run


def test_clusters_without_points_begin_again_where_points_are_far_off():
    # Rounding errors of many equal points far from the origin look like distances, so that some
    # first centres coincide and their clusters are empty.
    for seed in range(30):
        rng = np.random.default_rng(seed)
        place = 500 + 100 * rng.random(5)
        axes = np.linalg.qr(rng.standard_normal((5, 5)))[0]
        apart = place + 2.5 * np.concatenate([axes, -axes[:2]])
        points = np.concatenate([np.tile(place, (600, 1)), apart]).astype(np.float32)
        labels = run(kmeans_steps(points, 8, seed))
        assert len(np.unique(labels[:600])) == 1
        assert sorted(labels[[0, *range(600, 607)]]) == list(range(8)), seed


@pytest.mark.parametrize("n_clusters", [2, 3, 7])
def test_every_point_is_in_the_cluster_whose_mean_is_nearest(n_clusters):
    rng = np.random.default_rng(n_clusters)
    # Blobs far apart: rounds go on until nothing changes.
    middle = 40 * rng.standard_normal((n_clusters, 3))
    points = (middle[np.arange(300) % n_clusters] + rng.standard_normal((300, 3))).astype(
        np.float32
    )
    labels = run(kmeans_steps(points, n_clusters))
    means = np.array([points[labels == label].mean(axis=0) for label in range(n_clusters)])
    for point, label in zip(points, labels, strict=True):
        assert label == ((point - means) ** 2).sum(axis=1).argmin()
