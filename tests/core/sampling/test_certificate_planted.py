"""The certificate on errors that were put there, and intervals in closed form."""

import numpy as np
import pytest
from scipy.stats import chi2, poisson

from prt_core import run
from prt_core.sampling import CertificateSettings, Sampled, certificate_steps
from prt_core.sampling.intervals import binomial_interval, weighted_interval
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from prt_core.transport.visibility import unpack
from tests.benchmarks.certificate_coverage import true_errors
from tests.meshes import caster_of, plane, sphere

CUBE = CubeMap(8)


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes([sphere(10, 0.4, (0, 0, 0.5), name="ball"), plane(17, name="floor")])


@pytest.fixture(scope="module")
def truth(scene):
    return visibility_bits(scene, CUBE, caster_of(scene), slice(0, len(scene.points)))


def certified(scene, said, lights=None, seed=0, **settings):
    sampled = Sampled(said.copy(), np.zeros_like(said), 0)
    settings = CertificateSettings(seed=seed, **settings)
    return run(
        certificate_steps(scene, CUBE, caster_of(scene), sampled, lights or {}, settings)
    ), sampled


def flipped(truth, wrong):
    """Bits that are wrong at some directions, wherever something is seen there."""
    return truth & ~np.packbits(wrong, bitorder="little")


@pytest.mark.parametrize("where", ["corners of faces", "middles of faces", "near the horizon"])
def test_entries_are_weighed_by_the_square_of_their_cosine_integral(scene, truth, where):
    # Texels at the corners of a face are a fifth as large as those in its middle.
    size = CUBE.solid_angles
    wrong = {
        "corners of faces": size < np.quantile(size, 0.3),
        "middles of faces": size > np.quantile(size, 0.8),
        "near the horizon": np.abs(CUBE.directions[:, 2]) < 0.3,
    }[where]
    said = flipped(truth, wrong)
    sampled = Sampled(said, np.zeros_like(said), 0)
    wanted = true_errors(scene, CUBE, truth, sampled, {})
    estimates = np.mean(
        [[item.matrix.error for item in certified(scene, said, seed=s)[0]] for s in range(3)],
        axis=0,
    )
    for estimate, (error, _) in zip(estimates, wanted.values(), strict=True):
        assert 0.05 < error < 0.8
        assert estimate == pytest.approx(error, rel=0.06)


@pytest.mark.parametrize("direction", [2, 40, 300])
def test_relit_colours_are_weighed_by_their_light(scene, truth, direction):
    # A light from few texels, of which some are wrong at half of the points.
    light = np.full((CUBE.n_directions, 3), 1e-3, np.float32)
    near = CUBE.directions @ CUBE.directions[direction] > 0.9
    light[near] = [3, 2, 1]
    said = truth.copy()
    said[::2] = flipped(truth, near & (np.arange(CUBE.n_directions) % 2 == 0))[::2]
    sampled = Sampled(said, np.zeros_like(said), 0)
    wanted = true_errors(scene, CUBE, truth, sampled, {"spot": light})
    result = [certified(scene, said, {"spot": light}, seed)[0] for seed in range(3)]
    for number, (_, relit) in wanted.items():
        estimates = [items[number].relit["spot"] for items in result]
        mean = np.sqrt(np.mean([one.error**2 for one in estimates]))
        assert mean == pytest.approx(relit["spot"], rel=0.12, abs=1e-6)
        assert sum(one.low <= relit["spot"] * 1.0001 <= one.high * 1.0002 for one in estimates) >= 2


def test_what_is_below_a_horizon_is_never_wrong():
    # Shading normals that lean: directions above them and below the surface are dark.
    floor = plane(17, name="floor")
    lean = np.array([0.6, 0, 0.8])
    floor.corner_normal = np.broadcast_to(lean, floor.corner_normal.shape).copy()
    scene = Scene.from_meshes([floor, sphere(8, 0.3, (0, 0, 0.5), name="ball")])
    truth = visibility_bits(scene, CUBE, caster_of(scene), slice(0, len(scene.points)))
    result, sampled = certified(scene, truth)
    for item in result:
        assert item.wrong == 0 and item.matrix.error == 0 and item.entries > 1000
    np.testing.assert_array_equal(sampled.bits, truth)


def test_draws_tell_how_much_is_lit(scene, truth):
    result, _ = certified(scene, truth)
    for number, item in enumerate(result):
        mine = scene.points.object_index == number
        worth = np.maximum(scene.points.normals[mine] @ CUBE.vectors.T, 0) ** 2
        lit = (worth * unpack(truth[mine], CUBE.n_directions)).sum() / worth.sum()
        spread = np.sqrt(lit * (1 - lit) / item.entries)
        assert item.lit / item.entries == pytest.approx(lit, abs=4 * spread)
        # About as many as were asked for: one proposal in six is kept.
        assert item.entries == pytest.approx(1 << 14, rel=0.1)


@pytest.mark.parametrize("count", [1, 3, 20])
@pytest.mark.parametrize("weight", [0.2, 5.0])
def test_equal_weights_have_the_interval_of_their_count(count, weight):
    low, high = weighted_interval(np.full(count, weight))
    # Exact above: chi-squared of 2 (n + 1) degrees; below half of the count itself counts.
    assert high == pytest.approx(weight * chi2.ppf(0.975, 2 * (count + 1)) / 2)
    mean = low / weight
    more = poisson.sf(count, mean) + poisson.pmf(count, mean) / 2
    assert more == pytest.approx(0.025, abs=1e-4)


def test_what_was_not_seen_widens_an_interval():
    none = np.zeros(0)
    assert weighted_interval(none) == (0, 0)
    low, high = weighted_interval(none, 2.0)
    # None of a Poisson count is seen one in forty times where 3.69 are expected.
    assert low == 0 and high == pytest.approx(2.0 * -np.log(0.025))
    weights = np.array([1.0, 0.5, 0.5])
    plain, same, more = (weighted_interval(weights, unseen) for unseen in (0.0, 1.0, 4.0))
    assert plain == same and more[1] > 1.5 * plain[1]


@pytest.mark.parametrize("count, n", [(0, 40), (1, 40), (7, 40), (40, 40)])
def test_a_share_has_the_bounds_of_clopper_and_pearson_above(count, n):
    from scipy.stats import binom

    low, high = binomial_interval(count, n)
    if count < n:
        assert binom.cdf(count, n, high) == pytest.approx(0.025, abs=1e-6)
    if count:
        more = binom.sf(count, n, low) + binom.pmf(count, n, low) / 2
        assert more == pytest.approx(0.025, abs=1e-6)
    assert (low == 0) == (count == 0) and (high == 1) == (count == n)


def test_rows_that_are_found_surely_widen_nothing(scene, truth):
    # Twenty rows, dark where they see most: each is drawn many times, and then known.
    said = truth.copy()
    lit = np.flatnonzero(unpack(truth, CUBE.n_directions).sum(axis=1) > 60)
    index = scene.points.object_index
    for number in (0, 1):
        said[lit[index[lit] == number][::5][:20]] = 0
    lights = {"even sky": np.ones((CUBE.n_directions, 3), np.float32)}
    sampled = Sampled(said, np.zeros_like(said), 0)
    wanted = true_errors(scene, CUBE, truth, sampled, lights)
    result, after = certified(scene, said, lights, 3)
    for item, (_, relit) in zip(result, wanted.values(), strict=True):
        estimate = item.relit["even sky"]
        assert item.rows == 20 and relit["even sky"] > 0.1
        assert estimate.error == pytest.approx(relit["even sky"], rel=0.005)
        assert estimate.high - estimate.low < 0.02 * estimate.error
    # They are put right.
    np.testing.assert_array_equal(after.bits, truth)


def test_where_nothing_is_found_something_may_be_hidden(scene, truth):
    lights = {"even sky": np.ones((CUBE.n_directions, 3), np.float32)}
    highs = []
    for entries in (1 << 18, 1):
        result, _ = certified(scene, truth, lights, 0, entries=entries)
        for item in result:
            estimate = item.relit["even sky"]
            assert estimate.error == estimate.low == 0 < estimate.high < 0.05
        highs.append([item.relit["even sky"].high for item in result])
    assert (np.array(highs[0]) <= highs[1]).all()


def test_light_that_is_received_is_summed_over_all_points():
    # More points than are looked at for how much light there is.
    floor = Scene.from_meshes([plane(61), sphere(5, 0.3, (0, 0, 0.4), name="ball")], max_hidden=0)
    truth = visibility_bits(floor, CUBE, caster_of(floor), slice(0, len(floor.points)))
    said = flipped(truth, CUBE.directions[:, 2] > 0.98)
    lights = {"even sky": np.ones((CUBE.n_directions, 3), np.float32)}
    wanted = true_errors(floor, CUBE, truth, Sampled(said, np.zeros_like(said), 0), lights)
    assert (floor.points.object_index == 0).sum() > 3000
    error = wanted[0][1]["even sky"]
    result, _ = certified(floor, said, lights)
    assert 0.02 < error < 0.1 and result[0].relit["even sky"].error == pytest.approx(error, rel=0.1)
