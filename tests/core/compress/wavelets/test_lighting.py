import numpy as np
import pytest

from prt_core import PRTError
from prt_core.compress import (
    ArrayRows,
    HaarLighting,
    Harmonics,
    IncrementalLighting,
    Irradiance,
    TransportRows,
)
from prt_core.light import EnvironmentMap
from tests.core.compress.conftest import relative


@pytest.fixture(scope="module")
def rows(transport):
    return TransportRows(transport, 80)


@pytest.fixture(scope="module")
def haar(rows):
    return HaarLighting(n_terms=None, step=1e-5).fit(rows)


def test_all_wavelets_and_fine_steps_are_exact(transport, haar, light):
    assert relative(haar.product(light), transport.product(light)) < 1e-2
    light = light.copy()
    light[100] = 1
    assert relative(haar.product(light), transport.product(light)) < 2e-3


def test_coarser_steps_are_smaller_and_worse(transport, rows, light):
    light = np.minimum(light, 2)
    truth = transport.product(light)
    models = [HaarLighting(n_terms=None, step=s).fit(rows) for s in (1e-1, 1e-2, 1e-3)]
    sizes = [m.nbytes for m in models]
    errors = [relative(m.product(light), truth) for m in models]
    assert sizes == sorted(sizes) and errors == sorted(errors, reverse=True)


@pytest.mark.parametrize("selection", ["unweighted", "area", "transport"])
def test_more_terms_come_nearer(haar, light, selection):
    every = haar.product(light)
    errors = []
    for n in (5, 40, 200, 384):
        errors.append(relative(haar.products(*haar.terms(light, n, selection)), every))
    assert errors[0] > errors[-1] and errors[-1] < 1e-6


def test_weights_of_area_and_transport_choose_better(transport, haar):
    rng = np.random.default_rng(5)
    errors = {"unweighted": [], "area": [], "transport": []}
    for _ in range(8):
        shares = rng.random((transport.n_directions, 1), np.float32) ** 12 * 9
        light = shares * np.ones(3, np.float32)
        every = haar.product(light)
        for name, result in errors.items():
            result.append(relative(haar.products(*haar.terms(light, 40, name)), every))
    mean = {name: np.mean(result) for name, result in errors.items()}
    assert mean["transport"] < mean["area"] < 0.8 * mean["unweighted"]


def test_a_still_light_converges_frame_by_frame(haar, light):
    frames = IncrementalLighting(haar, 60)
    every = haar.product(light)
    errors = [relative(frames.product(light), every) for _ in range(8)]
    assert errors[-1] < 1e-6 and all(a >= b for a, b in zip(errors[:-1], errors[1:], strict=True))
    # A small change is followed within one frame.
    other = light.copy()
    other[7] += 3
    assert relative(frames.product(other), haar.product(other)) < 1e-6


def test_settings_are_checked(rows):
    with pytest.raises(PRTError, match="selection"):
        HaarLighting(selection="best").fit(rows)
    with pytest.raises(PRTError, match="texels"):
        HaarLighting().fit(ArrayRows(np.zeros((3, 24))))
    with pytest.raises(PRTError, match="order"):
        Harmonics(11).fit(rows)
    with pytest.raises(PRTError, match="normals"):
        Irradiance().fit(ArrayRows(np.zeros((3, 24)), 2))


def test_an_even_sky_needs_one_harmonic(transport, rows):
    light = np.full((transport.n_directions, 3), 1e5, np.float32)
    truth = transport.product(light)
    for order in (1, 4):
        assert relative(Harmonics(order).fit(rows).product(light), truth) < 5e-3


def test_higher_orders_come_nearer(transport, rows, light):
    light = np.minimum(light, 20)
    truth = transport.product(light)
    errors = [relative(Harmonics(n).fit(rows).product(light), truth) for n in (1, 2, 4, 8)]
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.5 * errors[0]


def test_turned_coefficients_are_those_of_the_turned_light(transport, rows):
    rng = np.random.default_rng(0)
    environment = EnvironmentMap(rng.random((16, 32, 3), np.float32) ** 3)
    model = Harmonics(3).fit(rows)
    still = model.project(environment.to_cube_map(transport.cube_map))
    turned = model.product(environment.to_cube_map(transport.cube_map, rotation=40.0))
    assert relative(model.product_of_coefficients(still, 40.0), turned) < 5e-3


def test_irradiance_of_an_open_plate_is_right(transport, rows):
    light = (1 + transport.cube_map.directions[:, 2:] * np.ones(3)).astype(np.float32)
    model = Irradiance().fit(rows)
    up = transport.normals[:, 2] > 0.999
    # pi (A_0 / pi + A_1 / pi cos), seen from a point that looks up.
    result = model.product(light)[up]
    np.testing.assert_allclose(result, 1 + 2 / 3, rtol=5e-3)
    again = Irradiance.from_state(model.state())
    np.testing.assert_array_equal(again.product(light), model.product(light))
