"""Dense and sparse rows of Huang and Ramamoorthi's sampling, entry by entry in plain loops."""

import numpy as np
import pytest
from sklearn.linear_model import Lasso

from prt_core.runtime.progress import run
from prt_core.sampling.adaptive_angle import AngularGrid, adaptive_steps, windows
from prt_core.sampling.huang import HuangSettings, sample_huang
from prt_core.sampling.rivals import wang_columns
from prt_core.sampling.sparse import sparse_blocks
from prt_core.sampling.tracer import Tracer
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport.visibility import horizon_bits, unpack
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(6)


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes([sphere(8, 0.3, (0, 0, 0.35)), plane(11)], max_hidden=0)


def flags(bits):
    return unpack(bits, CUBE.n_directions, np.uint8).astype(bool)


@pytest.mark.parametrize("window", [3, 7])
def test_a_direction_is_borrowed_only_from_samples_that_all_say_the_same(scene, window):
    points, grid = np.arange(0, len(scene.points), 7), AngularGrid(CUBE, window)
    rows = run(adaptive_steps(scene, Tracer(scene, CUBE, caster_of(scene)), points, grid))
    above, bits, traced, features = map(
        flags, (horizon_bits(scene, CUBE, points), rows.bits, rows.traced, rows.features)
    )
    around = windows(CUBE, window)
    borrowed = 0
    for row in range(len(points)):
        for direction in range(CUBE.n_directions):
            said = {
                bool(bits[row, t])
                for t in around[direction]
                if t >= 0 and grid.on_grid[t] and above[row, t]
            }
            if not above[row, direction]:
                assert not bits[row, direction] and not traced[row, direction]
            elif grid.on_grid[direction] or len(said) != 1:
                assert traced[row, direction]
            else:
                assert not traced[row, direction] and said == {bool(bits[row, direction])}
                borrowed += 1
            assert features[row, direction] == (above[row, direction] and len(said) == 2)
    assert borrowed > 100


@pytest.mark.parametrize("quantity", ["transport", "visibility"])
def test_sparse_rows_are_combinations_of_those_around(scene, quantity):
    settings = HuangSettings(features=12, quantity=quantity, strength=1e-2, radius=0.2)
    result = run(sample_huang(scene, CUBE, caster_of(scene), settings))
    dense, cosine = result.dense, scene.points.normals.astype(np.float64) @ CUBE.vectors.T
    cosine = np.maximum(cosine, 0)
    seen, traced, above = map(
        flags, (result.bits, result.traced, horizon_bits(scene, CUBE, slice(0, len(scene.points))))
    )
    rows = flags(dense.rows.bits)
    compared = close = 0
    for points, neighbours in sparse_blocks(scene, dense, settings):
        for point, near in list(zip(points, neighbours, strict=True))[::5]:
            near = near[near >= 0]
            votes = rows[near]
            varying = votes.any(axis=0) & ~votes.all(axis=0)
            asked = traced[point]
            assert asked.sum() <= 12 and not (asked & ~above[point]).any()
            # A neighbour's row of T, or its visibility with the point's own cosine.
            own = cosine[point]
            parts = votes * (cosine[dense.points[near]] if quantity == "transport" else own)
            combined = np.zeros(CUBE.n_directions)
            target = seen[point, asked] * own[asked]
            if target.any():
                columns = parts[:, asked].T
                strength = 1e-2 * np.abs(columns.T @ target).max()
                model = Lasso(strength / len(target), fit_intercept=False, tol=1e-12,
                              max_iter=500_000).fit(columns, target)  # fmt: skip
                weights = model.coef_
                combined = weights @ (parts if quantity == "transport" else votes)
            limit = settings.threshold * (own if quantity == "transport" else 1)
            for direction in np.flatnonzero(above[point] & ~asked):
                if not varying[direction]:
                    assert seen[point, direction] == votes[0, direction]
                elif abs(combined[direction] - np.broadcast_to(limit, 216)[direction]) > 1e-3 * (
                    own[direction] if quantity == "transport" else 1
                ):
                    compared += 1
                    wanted = combined[direction] > np.broadcast_to(limit, 216)[direction]
                    close += seen[point, direction] == wanted
    # But for the few where neighbours that are alike may share their weights otherwise.
    assert compared > 200 and close >= 0.97 * compared


def test_wang_takes_the_column_nearest_to_each_mean():
    rng = np.random.default_rng(0)
    middles = np.array([(0, 0, 9.0), (0, 8, 0), (7, 0, 1)])
    kind = np.repeat([0, 1, 2], [5, 9, 7])
    columns = middles[kind] + rng.normal(0, 0.5, (21, 3))
    chosen = wang_columns(columns.T.astype(np.float32), 3, np.random.default_rng(1))
    wanted = []
    for k in range(3):
        mine = np.flatnonzero(kind == k)
        distance = np.linalg.norm(columns[mine] - columns[mine].mean(axis=0), axis=1)
        wanted.append(mine[distance.argmin()])
    np.testing.assert_array_equal(chosen, wanted)
