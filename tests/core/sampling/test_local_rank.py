"""Ranks, radii and weights of sampling by exploration, against plain loops."""

import numpy as np
import pytest

from prt_core.runtime.progress import run
from prt_core.sampling.adaptive_angle import AdaptiveRows, AngularGrid
from prt_core.sampling.dense import (
    DensePoints,
    dense_steps,
    local_rank,
    sketch_matrix,
    sketched,
)
from prt_core.sampling.huang import HuangSettings
from prt_core.sampling.sparse import sparse_blocks
from prt_core.sampling.tracer import Tracer
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from tests.meshes import caster_of, plane, sphere


@pytest.mark.parametrize("scale", [1e-3, 1.0, 500.0])
def test_the_rank_counts_singular_values_above_a_share_of_the_largest(scale):
    rng = np.random.default_rng(0)
    values = np.array([1.0, 0.5, 0.2, 0.12, 0.08, 0.01])
    left = np.linalg.qr(rng.standard_normal((6, 6)))[0]
    right = np.linalg.qr(rng.standard_normal((30, 6)))[0].T
    rows = (scale * (left * values) @ right).astype(np.float32)
    positions = 0.01 * rng.random((6, 3))
    for threshold in (0.9, 0.3, 0.15, 0.1, 0.05, 1e-3):
        settings = HuangSettings(radius=1.0, rank_neighbours=6, rank_threshold=threshold)
        result = local_rank(positions, positions, rows, settings)
        np.testing.assert_array_equal(result, np.count_nonzero(values > threshold))


def test_the_rank_is_that_of_the_nearest_dense_points_within_the_radius():
    rng = np.random.default_rng(1)
    positions, places = rng.random((30, 3)), rng.random((50, 3))
    rows = rng.standard_normal((50, 40)) * 0.5 ** rng.integers(0, 9, (50, 1))
    settings = HuangSettings(radius=0.25, rank_neighbours=5, rank_threshold=0.1)
    result = local_rank(positions, places, rows.astype(np.float32), settings)
    counts = []
    for position, rank in zip(positions, result, strict=True):
        distance = np.linalg.norm(places - position, axis=1)
        near = [i for i in np.argsort(distance)[:5] if distance[i] < 0.25]
        counts.append(len(near))
        if len(near) < 2:
            assert rank == 5
            continue
        values = np.linalg.svd(rows[near], compute_uv=False)
        assert rank == (values > 0.1 * values[0]).sum()
    assert min(counts) < 2 and max(counts) == 5 and len(set(counts)) > 3


@pytest.mark.parametrize("radius", [0.02, 0.1, 0.3])
def test_sparse_points_take_the_dense_ones_within_the_radius(radius):
    scene = Scene.from_meshes([sphere(8, 0.3, (0, 0, 0.35)), plane(15)], max_hidden=0)
    dense = np.sort(np.random.default_rng(0).choice(len(scene.points), 70, replace=False))
    rows = AdaptiveRows(*(np.zeros((70, 3), np.uint8) for _ in range(3)))
    dense = DensePoints(dense, rows, np.zeros(70, np.int32), np.ones(len(scene.points), np.int32))
    settings = HuangSettings(radius=radius, normal_weight=0.05, neighbours=7, fewest=2)
    points = scene.points
    # No two are as far from a third.
    points.positions += 0.01 * np.random.default_rng(1).random(points.positions.shape, np.float32)
    places = np.hstack([points.positions, 0.05 * points.normals]).astype(np.float64)
    asked, counts = [], set()
    for subset, neighbours in sparse_blocks(scene, dense, settings):
        for point, near in zip(subset, neighbours, strict=True):
            mine = points.object_index[dense.points] == points.object_index[point]
            distance = np.linalg.norm(places[dense.points] - places[point], axis=1)
            order = [i for i in np.argsort(distance, kind="stable") if mine[i]][:7]
            wanted = [i for n, i in enumerate(order) if n < 2 or distance[i] <= radius]
            assert near[near >= 0].tolist() == wanted
            counts.add(len(wanted))
        asked += subset.tolist()
    assert sorted([*asked, *dense.points.tolist()]) == list(range(len(points)))
    assert len(counts) > 2 and min(counts) == 2


def test_sketches_are_projected_rows_of_the_transport():
    scene = Scene.from_meshes([sphere(6, 0.3, (0, 0, 0.35)), plane(5)], max_hidden=0)
    grid = AngularGrid(CubeMap(4))
    rng = np.random.default_rng(3)
    points = np.array([3, 17, 40, 55])
    seen = rng.random((4, 96)) < 0.6
    sketch = sketch_matrix(grid, 0, 7)
    assert sketch.shape == (24, 7)
    np.testing.assert_allclose(np.abs(sketch), 7**-0.5, rtol=1e-6)
    result = sketched(scene, grid, points, np.packbits(seen, axis=1, bitorder="little"), sketch)
    wanted = np.zeros((4, 7))
    for row, point in enumerate(points):
        for place, direction in enumerate(grid.grid):
            if seen[row, direction]:
                cosine = scene.points.normals[point] @ CubeMap(4).vectors[direction]
                wanted[row] += cosine * sketch[place]
    np.testing.assert_allclose(result, wanted, atol=1e-5)


def test_a_higher_power_of_the_rank_draws_more_where_it_is_high():
    scene = Scene.from_meshes([sphere(10, 0.3, (0, 0, 0.35)), plane(23)], max_hidden=0)
    cube_map, shares, counts = CubeMap(8), [], []
    floor = scene.points.object_index == 1
    below = np.linalg.norm(scene.points.positions[:, :2], axis=1) < 0.25
    for power in (1e-3, 2.0, 6.0):
        settings = HuangSettings(radius=0.25, rank_power=power)
        tracer = Tracer(scene, cube_map, caster_of(scene))
        dense = run(dense_steps(scene, tracer, AngularGrid(cube_map), settings))
        drawn = np.isin(np.arange(len(scene.points)), dense.points)
        shares.append(drawn[floor & below].mean() / drawn[floor].mean())
        counts.append(np.bincount(dense.iteration))
        assert drawn[floor].mean() == pytest.approx(0.25, abs=0.01)
    # Without it about as many as anywhere.
    assert shares[0] < 1.5 < shares[0] + 0.3 < shares[1] < shares[2] - 0.2
    # A fifth at first, then as many in each turn.
    for count in counts:
        assert len(count) == 5 and count[0] == pytest.approx(0.2 * count.sum(), rel=0.1)
        assert np.ptp(count[1:]) <= 0.1 * count.sum()
