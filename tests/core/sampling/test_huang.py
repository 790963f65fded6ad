from dataclasses import replace

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.runtime.progress import Pace, run
from prt_core.sampling import sampler_named
from prt_core.sampling.adaptive_angle import AngularGrid
from prt_core.sampling.dense import dense_steps, local_rank, sketch_matrix
from prt_core.sampling.huang import HuangSettings, sample_huang
from prt_core.sampling.tracer import Tracer
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from prt_core.transport.visibility import horizon_bits, unpack
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(8)


def ball_on_floor(n=23, scale=1.0):
    ball = sphere(12, 0.3 * scale, (0, 0, 0.35 * scale))
    return Scene.from_meshes([ball, plane(n, -scale, scale)])


@pytest.fixture(scope="module")
def scene():
    return ball_on_floor()


def sampled(scene, pace=None, **settings):
    rays = []
    steps = sample_huang(
        scene, CUBE, caster_of(scene), HuangSettings(**settings), rays.append, pace
    )
    return run(steps), sum(rays)


def matrix_error(scene, bits, truth):
    """Relative L2 of the cosine-weighted rows."""
    cosine = scene.points.normals @ CUBE.vectors.T.astype(np.float32)
    result, wanted = (unpack(b, CUBE.n_directions) * cosine for b in (bits, truth))
    return np.linalg.norm(result - wanted) / np.linalg.norm(wanted)


def truth_of(scene):
    return visibility_bits(scene, CUBE, caster_of(scene), slice(0, len(scene.points)))


def test_it_is_near_the_truth_at_a_share_of_the_rays(scene):
    truth = truth_of(scene)
    result, rays = sampled(scene, features=40)
    assert rays == result.rays == np.unpackbits(result.traced).sum()
    above = horizon_bits(scene, CUBE, slice(0, len(scene.points)))
    assert result.rays < 0.45 * np.unpackbits(above).sum()
    np.testing.assert_array_equal(result.bits & result.traced, truth & result.traced)
    assert not (result.bits & ~above).any()
    error = matrix_error(scene, result.bits, truth)
    assert error < 0.08
    # A tenth of the directions instead tells what the features are worth.
    fewer, _ = sampled(scene, features=3)
    assert matrix_error(scene, fewer.bits, truth) > error
    assert result.attributes["duality_gap"] < 1e-6
    assert 0 < result.attributes["neighbours_used"] <= 12


@pytest.mark.parametrize(
    "settings",
    [
        {"reconstruction": "least_squares"},
        {"quantity": "visibility"},
        {"columns": "hasan", "reduced_rows": 50},
        {"columns": "wang", "reduced_rows": 50},
    ],
)
def test_every_variant_is_near_the_truth(scene, settings):
    result, _ = sampled(scene, features=40, **settings)
    truth = truth_of(scene)
    np.testing.assert_array_equal(result.bits & result.traced, truth & result.traced)
    assert matrix_error(scene, result.bits, truth) < 0.15


def test_full_traces_everything_but_what_dense_points_borrow(scene):
    result, _ = sampled(scene, reconstruction="full")
    truth = truth_of(scene)
    assert matrix_error(scene, result.bits, truth) < 0.03
    above = horizon_bits(scene, CUBE, slice(0, len(scene.points)))
    whole = (result.traced == above).all(axis=1)
    assert whole.mean() >= 0.74


def test_the_same_seed_gives_the_same_bytes_at_any_pace(scene):
    first, _ = sampled(scene, features=40)
    for pace in (Pace(1e-4), Pace(1e-2, 3)):
        again, _ = sampled(scene, pace, features=40)
        np.testing.assert_array_equal(again.bits, first.bits)
        np.testing.assert_array_equal(again.traced, first.traced)
    other, _ = sampled(scene, features=40, seed=1)
    assert (other.traced != first.traced).any()


@pytest.mark.parametrize("scale", [1e-3, 1e5])
def test_the_scale_of_the_scene_does_not_matter(scene, scale):
    wanted, _ = sampled(scene, features=40)
    result, _ = sampled(ball_on_floor(scale=scale), features=40)
    differ = np.unpackbits(result.bits ^ wanted.bits).mean()
    assert differ < 1e-3


def test_tiny_and_empty_objects():
    # Fewer points than dense ones, than neighbours, than directions; alone in a large radius.
    scene = Scene.from_meshes([plane(2), plane(3, 4, 5, name="far"), sphere(3, 0.1, (0, 0, 9))])
    result, _ = sampled(scene, radius=1e-6, fewest_dense=1, dense_share=0.01)
    assert matrix_error(scene, result.bits, truth_of(scene)) < 0.5
    everything, _ = sampled(scene, dense_share=1.0)
    assert everything.attributes["sparse_entries"] == 0
    assert matrix_error(scene, everything.bits, truth_of(scene)) < 0.05


def test_a_dark_scene_stays_dark():
    scene = Scene.from_meshes([sphere(8, inside=True)])
    result, _ = sampled(scene)
    assert not result.bits.any()


def test_an_open_scene_stays_open():
    scene = Scene.from_meshes([plane(9)])
    result, _ = sampled(scene, radius=0.5)
    np.testing.assert_array_equal(result.bits, truth_of(scene))
    assert result.attributes["mean_rank"] == 1


def test_where_all_neighbours_agree_their_value_is_taken():
    # Both sides of a free sheet, worked on together: each sees its own half and nothing else,
    # though no direction tells a point's own neighbours apart and none is traced.
    scene = Scene.from_meshes([plane(9, two_sided=True)])
    result, _ = sampled(scene, radius=0.5, normal_weight=1.0)
    np.testing.assert_array_equal(result.bits, truth_of(scene))
    assert result.attributes["sparse_entries"] == 0


def dense_of(scene, **settings):
    settings = HuangSettings(**settings)
    tracer = Tracer(scene, CUBE, caster_of(scene))
    return run(dense_steps(scene, tracer, AngularGrid(CUBE), settings)), settings


def test_exploration_goes_where_the_rank_is_high(scene):
    dense, settings = dense_of(scene, radius=0.25)
    floor = scene.points.object_index == 1
    share = np.isin(np.arange(len(scene.points)), dense.points)
    for mine in (floor, ~floor):
        assert share[mine].mean() == pytest.approx(settings.dense_share, abs=0.01)
    assert (np.bincount(dense.iteration) > 0).all()
    assert len(np.bincount(dense.iteration)) == settings.iterations + 1
    below = np.linalg.norm(scene.to_world(scene.points.positions)[:, :2], axis=1) < 0.5
    near, far = floor & below, floor & ~below
    assert dense.rank[near].mean() > 1.5 * dense.rank[far].mean()
    assert share[near].mean() > 1.3 * share[far].mean()
    # The first iteration knows nothing of that.
    first = np.isin(np.arange(len(scene.points)), dense.points[dense.iteration == 0])
    assert first[near].mean() < 0.12


def test_the_local_rank_is_that_of_the_rows():
    rng = np.random.default_rng(0)
    grid = AngularGrid(CubeMap(16))
    sketch = sketch_matrix(grid, 0)
    settings = replace(HuangSettings(), radius=1.0, rank_neighbours=8, rank_threshold=1e-3)
    positions = rng.random((8, 3)) * 0.1
    for rank in (1, 3, 5):
        rows = rng.random((8, rank)) @ rng.standard_normal((rank, len(grid.grid)))
        result = local_rank(positions[:2], positions, (rows @ sketch).astype(np.float32), settings)
        np.testing.assert_array_equal(result, rank)
    alone = local_rank(positions + 9, positions, np.ones((8, 96), np.float32), settings)
    np.testing.assert_array_equal(alone, 8)


def test_bad_settings_are_refused_in_one_line():
    for settings in (
        {"dense_share": 0},
        {"features": 0},
        {"window": 6},
        {"radius": np.nan},
        {"reconstruction": "magic"},
        {"columns": "random"},
        {"quantity": "bits"},
        {"iterations": -1},
        {"strength": 0},
    ):
        with pytest.raises(PRTError, match=f"^{next(iter(settings))}: [^\n]+$"):
            HuangSettings(**settings)


def test_it_is_known_by_its_name():
    assert sampler_named("huang") == (sample_huang, HuangSettings)
