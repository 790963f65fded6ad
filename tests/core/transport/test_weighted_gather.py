"""K of rays that weigh: sums over rays by hand, and an integral over all directions."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import gather_directions, gather_hits, gather_operator, ray_ends
from prt_core.transport.gather import DARK, MISS, NOT_CAST, REPRESENTED, ROUND
from tests.meshes import caster_of, plane, wall

N_POINTS, N_RAYS = 7, 3 * ROUND


def rays():
    """Rows of rays, some of which stand for others, and what each of them ended at."""
    rng = np.random.default_rng(3)
    ends = rng.integers(DARK, N_POINTS, (5, N_RAYS)).astype(np.int32)
    hits = ends.copy()
    for x in range(4):
        for turn in range(3):
            representative, *represented = turn * ROUND + rng.choice(ROUND, 6, replace=False)
            hits[x, represented] = REPRESENTED - representative % ROUND
            ends[x, represented] = ends[x, representative]
    hits[4] = ends[4] = MISS
    return hits, ends, rng


def by_hand(ends, weights):
    result = np.zeros((len(ends), N_POINTS))
    for x, row in enumerate(ends):
        for i, y in enumerate(row):
            if y >= 0:
                result[x, y] += weights[x, i] / len(row)
    return result


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int64])
@pytest.mark.parametrize("blocked", [None, np.array([0.5, 1, 0.01, 0.3, 0.2], np.float32)])
def test_weights_of_one_give_k_bit_for_bit(dtype, blocked):
    hits, _, _ = rays()
    plain = gather_operator(hits, N_POINTS, blocked)
    result = gather_operator(hits, N_POINTS, blocked, np.ones(hits.shape, dtype))
    assert plain.nnz == 4 * N_POINTS
    for name in ("data", "indices", "indptr"):
        one, other = getattr(plain, name), getattr(result, name)
        assert one.dtype == other.dtype and one.tobytes() == other.tobytes()


def test_each_ray_weighs_by_itself_also_where_another_stands_for_it():
    hits, ends, rng = rays()
    weights = rng.random(hits.shape)
    result = gather_operator(hits, N_POINTS, weights=weights)
    wanted = by_hand(ends, weights)
    assert result.dtype == np.float32 and result.shape == (5, N_POINTS)
    np.testing.assert_allclose(result.toarray(), wanted, rtol=1e-6)
    # Nor are they the same where those that were not cast weigh as those that were.
    slot = np.arange(N_RAYS)
    cast = np.where(hits <= REPRESENTED, slot - slot % ROUND + REPRESENTED - hits, slot)
    shared = by_hand(ends, np.take_along_axis(weights, cast, axis=1))
    assert abs(shared[:4] - wanted[:4]).max() > 0.01


def test_weights_of_nothing_leave_rows_empty():
    hits, ends, rng = rays()
    weights = rng.random(hits.shape)
    weights[1] = 0
    weights[2, ends[2] == 3] = 0
    for blocked in (None, np.full(5, 0.5, np.float32)):
        result = gather_operator(hits, N_POINTS, blocked, weights)
        assert np.diff(result.indptr).tolist() == [N_POINTS, 0, N_POINTS - 1, N_POINTS, 0]
        assert (result.data > 0).all() and result[2, 3] == 0


def test_rows_meet_as_much_weight_as_is_blocked():
    hits, ends, rng = rays()
    weights = rng.random(hits.shape) * [[1], [4], [1], [1], [1]]
    # Of the fourth row one ray is all: it tells too little to be scaled by.
    weights[3] *= 1e-6
    weights[3, np.flatnonzero(ends[3] >= 0)[0]] = 1
    blocked = np.array([0.3, 2.5, 0.001, 0.4, 0.5], np.float32)
    result = gather_operator(hits, N_POINTS, blocked, weights).toarray()
    wanted = by_hand(ends, weights)
    met = np.where(ends != MISS, weights, 0).sum(axis=1) / N_RAYS
    scale = np.where([True, True, False, False, True], blocked / np.maximum(met, 1e-9), 1)
    np.testing.assert_allclose(result, wanted * scale[:, None], rtol=1e-6)
    assert (abs(scale[:2] - 1) > 0.1).all()


@pytest.fixture(scope="module")
def corner():
    """A floor and a wall on it, both lit from where the rays of the floor come."""
    return Scene.from_meshes([plane(5, -1, 1), wall(0.9, 1.3, 1.1, n=3)], max_hidden=0)


def lobe(directions, power):
    """(..., 2): in-factors of a point that faces up, without the cosine."""
    axes = np.array([[0, 0, 1], [0.8, 0, 0.6]], np.float32)
    return np.maximum(directions @ axes.T, 0) ** power


@pytest.mark.parametrize("power", [2, 11])
def test_lobes_gather_what_all_directions_do(corner, power):
    """The light of a lobe, cosine included, from rays against a sum over 55,296 directions."""
    caster, n_points = caster_of(corner), len(corner.points)
    every = slice(0, n_points)
    hits = np.hstack([gather_hits(corner, caster, every, 0, turn).hits for turn in range(64)])
    ways = np.concatenate([gather_directions(corner, every, 0, turn) for turn in range(64)], axis=1)
    # Linear on each triangle, so that what lies between points is known everywhere.
    world = corner.to_world(corner.points.positions)
    radiance = 1 + 0.7 * world[:, 2] - 0.3 * world[:, 1]
    floor = np.flatnonzero((corner.points.object_index == 0) & (world[:, 0] < 0.8))
    assert len(floor) == 20
    cube = CubeMap(96)
    up = cube.directions[:, 2] > 0
    directions, angles = cube.directions[up], cube.solid_angles[up]
    wanted = []
    for x in floor:
        starts = np.tile(corner.ray_origins[x], (len(directions), 1))
        result = caster.intersect(starts, directions.astype(np.float32))
        met = np.flatnonzero(result.triangle >= 0)
        second, third = result.barycentric[met].T.astype(float)
        a, b, c = corner.vertices[corner.triangles[result.triangle[met]]].transpose(1, 0, 2)
        place = a + second[:, None] * (b - a) + third[:, None] * (c - a)
        place = corner.to_world(place)
        sent = 1 + 0.7 * place[:, 2] - 0.3 * place[:, 1]
        share = lobe(directions[met], power) * (directions[met, 2] * angles[met] * sent)[:, None]
        wanted.append(share.sum(axis=0))
    caster.close()
    wanted = np.array(wanted)
    for term in range(2):
        weights = lobe(ways, power)[..., term] * np.pi
        result = (gather_operator(hits, n_points, weights=weights) @ radiance)[floor]
        # Four standard deviations of a mean of independent rays, and the texels' own error.
        brought = weights[floor] * np.append(radiance, [0, 0])[ray_ends(hits)[floor]]
        spread = brought.std(axis=1) / np.sqrt(hits.shape[1])
        assert (np.abs(result - wanted[:, term]) < 4 * spread + 2e-3 * wanted[:, term]).all()
        assert np.linalg.norm(result - wanted[:, term]) < 0.03 * np.linalg.norm(wanted[:, term])
    # Weights of their own, not those of another ray.
    turned = np.roll(lobe(ways, power)[..., 1], 1, axis=1) * np.pi
    result = (gather_operator(hits, n_points, weights=turned) @ radiance)[floor]
    assert np.linalg.norm(result - wanted[:, 1]) > 0.1 * np.linalg.norm(wanted[:, 1])


def test_the_share_that_is_blocked_makes_narrow_lobes_better(corner):
    """Few rays, scaled to what is blocked within the lobe, are nearer to the truth of many."""
    caster, n_points = caster_of(corner), len(corner.points)
    every = slice(0, n_points)
    floor = corner.points.object_index == 0
    hits = [gather_hits(corner, caster, every, 0, turn).hits for turn in range(80)]
    ways = [gather_directions(corner, every, 0, turn) for turn in range(80)]
    caster.close()
    weights = [lobe(way, 5)[..., 1] * np.pi for way in ways]
    radiance = 1 + 0.3 * np.sin(np.arange(n_points))
    rest = slice(16, None)
    hit, weight = np.hstack(hits[rest]), np.hstack(weights[rest])
    truth = gather_operator(hit, n_points, weights=weight) @ radiance
    inside = (np.where(hit != MISS, weight, 0).mean(axis=1)).astype(np.float32)

    def error(scaled):
        result = [scaled(hits[turn], weights[turn]) for turn in range(16)]
        return np.linalg.norm((np.array(result) - truth)[:, floor])

    def plain(some, weight):
        return gather_operator(some, n_points, weights=weight) @ radiance

    def within_lobe(some, weight):
        return gather_operator(some, n_points, inside, weight) @ radiance

    def by_count(some, weight):
        met = np.maximum(np.count_nonzero(some != MISS, axis=1), 1) / ROUND
        share = np.count_nonzero(hit != MISS, axis=1) / hit.shape[1]
        return np.where(share * ROUND >= 2, share / met, 1) * plain(some, weight)

    assert error(within_lobe) < 0.8 * error(plain)
    # How many rays met something, whatever they weigh, says less of a lobe.
    assert error(within_lobe) < 0.9 * error(by_count)


@pytest.mark.parametrize(
    "weights, message",
    [
        (np.ones((5, N_RAYS - 1)), f"weights: expected an array of shape \\(5, {N_RAYS}\\)"),
        (np.ones((N_RAYS, 5)), "weights: expected an array of shape"),
        (np.ones((5, N_RAYS, 1)), "weights: expected an array of shape"),
        (np.full((5, N_RAYS), -1e-9), "weights: expected values from 0 to 1e\\+30, got -1e-09"),
        (np.full((5, N_RAYS), np.nan), "weights: 480 values are NaN or infinite"),
        (np.full((5, N_RAYS), np.inf), "weights: 480 values are NaN or infinite"),
        (np.full((5, N_RAYS), 1e31), "weights: expected values"),
        (np.full((5, N_RAYS), 1e-39), "blocked: expected what the weights add up to"),
        ("heavy", "weights: expected an array of numbers"),
    ],
)
def test_bad_weights_are_said_in_one_line(weights, message):
    hits, _, _ = rays()
    with pytest.raises(PRTError, match=message) as caught:
        gather_operator(hits, N_POINTS, np.full(5, 0.5, np.float32), weights)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("blocked", [None, np.array([0.5, 1, 0.01, 0.3, 0.2], np.float32)])
@pytest.mark.parametrize("weighted", [False, True])
def test_rounds_in_which_a_point_takes_no_part_change_nothing(blocked, weighted):
    hits, _, rng = rays()
    weights = rng.random(hits.shape) if weighted else None
    short = None if weights is None else weights[:, : 2 * ROUND]
    wanted = gather_operator(hits[:, : 2 * ROUND], N_POINTS, blocked, short)
    hits[:, 2 * ROUND :] = NOT_CAST
    result = gather_operator(hits, N_POINTS, blocked, weights)
    np.testing.assert_allclose(result.toarray(), wanted.toarray(), rtol=1e-6)
    hits[3] = NOT_CAST
    with pytest.raises(PRTError, match="at least one ray of every point"):
        gather_operator(hits, N_POINTS, blocked, weights)
