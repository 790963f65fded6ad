import numpy as np
import pytest
from scipy.stats import binom, poisson

from prt_core import run
from prt_core.sampling import (
    AgreementSettings,
    CertificateSettings,
    Sampled,
    certificate,
    certificate_steps,
    probe_lights,
    sample_agreement,
)
from prt_core.sampling.certificate import _inclusion, _kept_share, matrix_estimate
from prt_core.sampling.intervals import binomial_interval, weighted_interval
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from prt_core.transport import visibility_bits
from tests.benchmarks.certificate_coverage import coverage, scene_named, true_errors
from tests.meshes import caster_of, plane, sphere


@pytest.mark.parametrize("n, share", [(1000, 0.003), (1000, 0.01), (300, 0.1), (50, 0.5)])
def test_a_binomial_interval_holds_the_share_about_95_times_of_100(n, share):
    counts = np.arange(n + 1)
    weight = binom.pmf(counts, n, share)
    likely = counts[weight > 1e-9]
    held = [low <= share <= high for low, high in (binomial_interval(int(c), n) for c in likely)]
    assert 0.93 < weight[likely][held].sum() < 0.985


def test_a_binomial_interval_at_its_ends():
    assert binomial_interval(0, 100)[0] == 0 and 0.02 < binomial_interval(0, 100)[1] < 0.04
    assert binomial_interval(100, 100)[1] == 1
    low, high = binomial_interval(30, 100)
    assert low < 0.3 < high


@pytest.mark.parametrize("mean", [20, 60])
def test_a_weighted_interval_holds_the_sum_about_95_times_of_100(mean):
    rng = np.random.default_rng(0)
    kinds = np.array([1.0, 2.0, 7.0])
    rates = mean * np.array([0.6, 0.3, 0.1])
    held = 0
    for _ in range(400):
        weights = np.repeat(kinds, rng.poisson(rates))
        low, high = weighted_interval(weights)
        held += low <= kinds @ rates <= high
    assert 0.92 < held / 400 < 0.98


def test_equal_weights_are_a_poisson_count():
    low, high = weighted_interval(np.full(10, 2.0))
    # The mid-P bound below, where half of what is exactly at the count counts; the exact one above.
    assert abs(poisson.cdf(9, low / 2) + poisson.pmf(10, low / 2) / 2 - 0.975) < 1e-6
    assert abs(poisson.cdf(10, high / 2) - 0.025) < 1e-6


@pytest.fixture(scope="module")
def scene():
    return Scene.from_meshes([sphere(10, 0.4, (0, 0, 0.5), name="ball"), plane(17, name="floor")])


def test_intervals_hold_the_truth_for_every_object_and_light():
    rows = coverage(scene_named("balls"), "agreement", CubeMap(8), 12)
    assert len(rows) == 3 * 4
    held = sum(row["held"] for row in rows)
    # 144 intervals of 95 %: fewer than 124 would be a chance of one in 1,000.
    assert held >= 124, rows
    for row in rows:
        assert row["true"] > 0 and 0.7 < row["mean_estimate"] / row["true"] < 1.4, row


def test_estimates_of_few_draws_are_right_on_average(monkeypatch):
    # So few that most wrong rows are missed, and how likely each was to be found decides.
    monkeypatch.setattr(certificate, "_FEWEST", 1000)
    rows = coverage(scene_named("balls"), "agreement", CubeMap(8), 120, {"entries": 1})
    # Under a sun hardly any entry decides: too few for an average of so many seeds.
    rows = [row for row in rows if row["object"] == "plane" and "sun" not in row["what"]]
    assert len(rows) == 2
    for row in rows:
        assert row["mean_estimate"] == pytest.approx(row["true"], rel=0.12), row


def test_a_bake_that_is_all_traced_has_no_error(scene):
    cube_map, caster = CubeMap(8), caster_of(scene)
    bits = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    sampled = Sampled(bits, np.full_like(bits, 255), 0)
    steps = certificate_steps(scene, cube_map, caster, sampled, probe_lights(cube_map))
    for item in run(steps):
        assert item.matrix.high == 0 and all(e.high == 0 for e in item.relit.values())
    assert sampled.rays == 0


def test_a_bake_that_is_all_wrong_is_told_so(scene):
    cube_map, caster = CubeMap(8), caster_of(scene)
    bits = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    sampled = Sampled(np.zeros_like(bits), np.zeros_like(bits), 0)
    lights = probe_lights(cube_map)
    lights["none"] = np.zeros_like(lights["even sky"])
    for item in run(certificate_steps(scene, cube_map, caster, sampled, lights)):
        assert item.matrix.error == pytest.approx(1, abs=1e-12)
        assert item.matrix.low < 1 <= item.matrix.high
        assert item.relit["none"].error == 0
        assert item.worst >= 1


def test_half_of_the_rows_wrong_is_told_as_such(scene):
    # What is said to arrive is half of what does: relative to that the error would be 1.
    cube_map, caster = CubeMap(8), caster_of(scene)
    truth = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    said = truth.copy()
    said[::2] = 0
    lights = probe_lights(cube_map)
    sampled = Sampled(said, np.zeros_like(truth), 0)
    wanted = true_errors(scene, cube_map, truth, sampled, lights)
    result = run(certificate_steps(scene, cube_map, caster, sampled, lights))
    for (_, relit), item in zip(wanted.values(), result, strict=True):
        for name in lights:
            estimate = item.relit[name]
            assert 0.6 < relit[name] < 0.8
            assert estimate.error == pytest.approx(relit[name], rel=0.1)
            assert estimate.low < relit[name] < estimate.high < 1.2 * relit[name]


def test_points_that_see_no_surface_may_be_wrong():
    scene = Scene.from_meshes([plane(17, name="floor")])
    cube_map, caster = CubeMap(8), caster_of(scene)
    truth = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    lights = probe_lights(cube_map)
    for bits, error in ((truth, 0), (np.zeros_like(truth), 1)):
        sampled = Sampled(bits.copy(), np.zeros_like(truth), 0)
        (item,) = run(certificate_steps(scene, cube_map, caster, sampled, lights))
        assert item.matrix.error == pytest.approx(error)
        assert item.worst == pytest.approx(error)


def test_rows_are_kept_by_how_often_they_were_found():
    times = np.random.default_rng(0).poisson(2.0, 500) + 1
    times[:3] = 1000
    for n_rows in (1, 7, 101, 499):
        share = _kept_share(times, n_rows)
        assert np.minimum(1, share * times).sum() == pytest.approx(n_rows)
    assert _kept_share(times, 500) == 1 and _kept_share(np.array([], int), 3) == 1


@pytest.mark.parametrize("share", [1.0, 0.5, 0.3, 0.013])
def test_how_likely_a_row_is_found_and_kept(share):
    rates = np.array([1e-6, 0.2, 3.0, 40.0, 900.0])
    counts = np.arange(2000)[:, None]
    expected = (poisson.pmf(counts, rates) * np.minimum(1, share * counts)).sum(axis=0)
    np.testing.assert_allclose(_inclusion(rates, share), expected, rtol=1e-9)


def test_light_of_any_strength(scene):
    cube_map, caster = CubeMap(8), caster_of(scene)
    sampled = run(sample_agreement(scene, cube_map, caster, AgreementSettings()))
    light = probe_lights(cube_map)["low sun"]
    scales = {"dim": 1e-6, "as it is": 1.0, "bright": 1e5}
    lights = {name: light * np.float32(scale) for name, scale in scales.items()}
    for item in run(certificate_steps(scene, cube_map, caster, sampled, lights)):
        errors = [item.relit[name].error for name in scales]
        np.testing.assert_allclose(errors, errors[0], rtol=1e-4)


def test_rows_found_wrong_are_put_right(scene):
    cube_map, caster = CubeMap(8), caster_of(scene)
    truth = visibility_bits(scene, cube_map, caster, slice(0, len(scene.points)))
    sampled = run(sample_agreement(scene, cube_map, caster, AgreementSettings()))
    before = true_errors(scene, cube_map, truth, sampled, {})
    rows = sum(
        item.rows
        for item in run(certificate_steps(scene, cube_map, caster, sampled, probe_lights(cube_map)))
    )
    after = true_errors(scene, cube_map, truth, sampled, {})
    assert rows > 0
    assert all(after[key][0] <= before[key][0] for key in before)
    assert not ((sampled.bits ^ truth) & sampled.traced).any()


def test_the_same_seed_draws_the_same(scene):
    cube_map, caster = CubeMap(8), caster_of(scene)
    result = []
    for seed in (0, 0, 1):
        sampled = run(sample_agreement(scene, cube_map, caster, AgreementSettings()))
        subset = CertificateSettings(seed=seed)
        result.append(run(certificate_steps(scene, cube_map, caster, sampled, {}, subset)))
    assert result[0] == result[1] != result[2]


def test_nothing_drawn_is_no_error():
    assert matrix_estimate(0, 0, 0).high == 0
    assert matrix_estimate(100, 5, 0).error > 0
