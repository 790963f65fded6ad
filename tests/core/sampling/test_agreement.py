import numpy as np
import pytest

from prt_core import PRTError, run
from prt_core.runtime.progress import Pace
from prt_core.sampling import AgreementSettings, refine_agreement, sample_agreement
from prt_core.sampling.neighbours import Neighbours, surface_levels
from prt_core.sampling.tracer import count_bits
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from prt_core.transport.visibility import horizon_bits
from tests.meshes import caster_of, plane, sphere, wall


@pytest.fixture(scope="module")
def scene():
    ball = sphere(14, 0.4, (0.1, 0, 0.5), name="ball")
    return Scene.from_meshes([ball, plane(33, -1.3, 1.3, name="floor")])


@pytest.fixture(scope="module")
def truth(scene):
    cube_map = CubeMap(16)
    return visibility_bits(scene, cube_map, caster_of(scene), slice(0, len(scene.points)))


def sample(scene, resolution=16, pace=None, **settings):
    steps = sample_agreement(
        scene, CubeMap(resolution), caster_of(scene), AgreementSettings(**settings), pace=pace
    )
    return run(steps)


def matrix_error(scene, cube_map, truth, bits):
    wrong = np.unpackbits(truth ^ bits, axis=1, bitorder="little", count=cube_map.n_directions)
    right = np.unpackbits(truth, axis=1, bitorder="little", count=cube_map.n_directions)
    worth = np.maximum(scene.points.normals @ cube_map.vectors.T, 0) ** 2
    return np.sqrt((worth * wrong).sum() / (worth * right).sum())


def test_few_rays_and_a_small_error(scene, truth):
    sampled = sample(scene)
    above = horizon_bits(scene, CubeMap(16), slice(0, len(scene.points)))
    assert count_bits(sampled.traced) < 0.3 * count_bits(above)
    assert matrix_error(scene, CubeMap(16), truth, sampled.bits) < 0.03
    attributes = sampled.attributes
    reasons = ("first", "disagree", "check", "follow", "rest")
    assert sampled.rays == count_bits(sampled.traced) == sum(attributes[key] for key in reasons)
    assert sum(attributes["levels"]) + attributes["open_points"] == len(scene.points)


def test_what_was_traced_is_true_and_nothing_is_below_the_horizon(scene, truth):
    sampled = sample(scene)
    above = horizon_bits(scene, CubeMap(16), slice(0, len(scene.points)))
    assert not ((sampled.bits ^ truth) & sampled.traced).any()
    assert not (sampled.bits & ~above).any() and not (sampled.traced & ~above).any()


def errors_of(scene, truth, *variants):
    return [
        matrix_error(scene, CubeMap(16), truth, sample(scene, **settings).bits)
        for settings in variants
    ]


def test_checks_and_following_find_what_no_neighbour_saw(scene, truth):
    blind = {"checks": 0, "edge_halvings": 30, "looks": 0}
    careful = {"checks": 4, "edge_halvings": 3, "boundaries": True, "looks": 0}
    errors = errors_of(scene, truth, blind, careful)
    assert errors[1] < errors[0] / 2


def test_all_boundaries_of_what_contradicts(scene, truth):
    errors = errors_of(scene, truth, {"looks": 0}, {"looks": 0, "boundaries": True})
    assert errors[1] < errors[0]


def test_a_last_look_hears_of_what_others_found(scene, truth):
    base = {"checks": 2, "edge_halvings": 3, "look_share": 1.0}
    errors = errors_of(scene, truth, *({**base, "looks": looks} for looks in (0, 1, 2)))
    assert errors[1] < 0.7 * errors[0] and errors[2] <= errors[1]
    # None where everything was dear.
    dear, none = sample(scene, look_share=0.0), sample(scene, looks=0)
    np.testing.assert_array_equal(dear.traced, none.traced)


def test_a_last_look_finds_light_through_small_gaps():
    near = [(x, y, 0.3) for x in (-0.42, 0, 0.42) for y in (-0.42, 0, 0.42)]
    balls = [sphere(6, 0.2, place, name=f"ball {i}") for i, place in enumerate(near)]
    roof = Scene.from_meshes([plane(41, -1.2, 1.2, name="floor"), *balls])
    every = visibility_bits(roof, CubeMap(16), caster_of(roof), slice(0, len(roof.points)))
    floor = roof.points.object_index == 0
    missed = []
    for reach in (0, 2):
        result = sample(roof, look_share=1.0, look_reach=reach, looks=2)
        assert not ((result.bits ^ every) & result.traced).any()
        missed.append(int(count_bits((every & ~result.bits)[floor])))
    assert 0 < missed[1] < missed[0] / 3


def test_more_neighbours_leave_a_smaller_error(scene, truth):
    sampled = sample(scene)
    careful = AgreementSettings(neighbours=8, candidates=12, checks=64, edge_halvings=0)
    everyone = np.ones(len(scene.points), bool)
    refined = run(
        refine_agreement(scene, CubeMap(16), caster_of(scene), careful, sampled, everyone, 0)
    )
    errors = [matrix_error(scene, CubeMap(16), truth, s.bits) for s in (sampled, refined)]
    assert errors[1] < errors[0] / 2
    assert not ((refined.bits ^ truth) & refined.traced).any()
    assert not (sampled.traced & ~refined.traced).any()


@pytest.mark.parametrize("body", [sphere(10), plane(9)])
def test_a_convex_body_needs_no_ray(body):
    scene = Scene.from_meshes([body])
    assert scene.open_points.all()
    sampled = sample(scene, 8)
    assert sampled.rays == 0
    above = horizon_bits(scene, CubeMap(8), slice(0, len(scene.points)))
    np.testing.assert_array_equal(sampled.bits, above)


def test_open_points_see_no_surface(scene):
    result = scene.open_points
    floor = scene.points.object_index == 1
    assert result.any() and not result[floor].any()
    cube_map, points = CubeMap(16), np.flatnonzero(result)
    traced = visibility_bits(scene, cube_map, caster_of(scene), points)
    np.testing.assert_array_equal(traced, horizon_bits(scene, cube_map, points))


def test_the_same_seed_gives_the_same_bytes_at_any_pace(scene):
    first, again = sample(scene, seed=3), sample(scene, seed=3, pace=Pace(1e-4, 100))
    np.testing.assert_array_equal(first.bits, again.bits)
    np.testing.assert_array_equal(first.traced, again.traced)
    other = sample(scene, seed=4)
    assert (first.traced != other.traced).any()


@pytest.mark.parametrize("resolution", [1, 3, 7])
def test_odd_resolutions(scene, resolution):
    sampled = sample(scene, resolution)
    cube_map = CubeMap(resolution)
    truth = visibility_bits(scene, cube_map, caster_of(scene), slice(0, len(scene.points)))
    assert not ((sampled.bits ^ truth) & sampled.traced).any()
    assert (sampled.bits == truth).mean() > 0.9


def test_tiny_scenes_are_traced_whole():
    scene = Scene.from_meshes([plane(3, -1, 1), wall(0.5, 1.0, 1.0)], max_hidden=0)
    sampled = sample(scene, 8)
    truth = visibility_bits(scene, CubeMap(8), caster_of(scene), slice(0, len(scene.points)))
    np.testing.assert_array_equal(sampled.bits, truth)


def test_levels_hold_every_point_once_and_grow():
    scene = Scene.from_meshes([sphere(14, 0.4, (0, 0, 1)), plane(33)])
    levels = surface_levels(
        scene.points, scene.points.object_index, 20, 2.0, np.random.default_rng(0)
    )
    np.testing.assert_array_equal(np.sort(np.concatenate(levels)), np.arange(len(scene.points)))
    assert len(levels[0]) == 20 and len(levels) > 3
    # Strata: the first level's points come from all parts of both objects.
    assert len(np.unique(scene.points.object_index[levels[0]])) == 2


def test_neighbours_lie_around_and_in_the_same_object():
    scene = Scene.from_meshes([sphere(14, 0.4, (0, 0, 0.401), name="ball"), plane(33)])
    everyone = np.arange(len(scene.points))
    index = scene.points.object_index
    floor = np.flatnonzero((index == 1) & (np.abs(scene.points.positions[:, :2]).max(axis=1) < 0.3))
    around = Neighbours(scene.points, scene.points.object_index).around(
        everyone, floor, 3, 8, itself=True
    )
    assert (index[around] == 1).all() and (around != floor[:, None]).all()
    ways = scene.points.positions[around] - scene.points.positions[floor, None]
    # The second lies across from the first, not beside it.
    assert (np.einsum("nx,nx->n", ways[:, 0], ways[:, 1]) < 0).mean() > 0.9
    lonely = Neighbours(scene.points, scene.points.object_index).around(
        np.flatnonzero(index == 0), floor, 3, 8
    )
    assert (lonely == -1).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"neighbours": 0},
        {"candidates": 2},
        {"checks": -1},
        {"growth": 1.0},
        {"seed": 1.5},
        {"look_reach": -1},
    ],
)
def test_settings_are_checked(wrong):
    with pytest.raises(PRTError, match=next(iter(wrong))):
        AgreementSettings(**wrong)
