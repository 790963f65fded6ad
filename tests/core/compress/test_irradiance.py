"""Nine coefficients of irradiance against integrals over the clamped cosine."""

import numpy as np
import pytest

from prt_core.basis import harmonics
from prt_core.compress import ArrayRows, Harmonics, Irradiance, TransportRows
from prt_core.sphere import CubeMap
from tests.core.compress.conftest import relative

# Of Lambert's clamped cosine: 2 pi times the integral of P_l(t) t over 0..1.
FACTORS = [np.pi, 2 * np.pi / 3, np.pi / 4, 0.0]


@pytest.fixture(scope="module")
def model(transport):
    return Irradiance().fit(TransportRows(transport, 0))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_each_degree_is_weakened_by_its_own_factor(transport, model, degree):
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = (nodes + 1) / 2
    legendre = np.polynomial.legendre.Legendre.basis(degree)(half)
    assert 2 * np.pi * (weights / 2 * legendre * half).sum() == pytest.approx(FACTORS[degree])
    # Light of one harmonic on an even one, so that nothing is below zero.
    for index in range(degree**2, (degree + 1) ** 2):
        shape = harmonics(transport.cube_map.directions, 4)[:, index]
        light = (10 + shape[:, None] * [1, 2, 3]).astype(np.float32)
        result = model.product(light)
        along = harmonics(transport.normals, 4)[:, index]
        wanted = 10 + FACTORS[degree] / np.pi * along[:, None] * [1, 2, 3]
        if degree == 0:
            wanted = 10 + shape[0] * np.ones(len(wanted))[:, None] * [1, 2, 3]
        np.testing.assert_allclose(result, wanted, atol=0.02)


def test_behind_a_hard_light_nothing_is_below_zero(transport, model):
    light = np.zeros((transport.n_directions, 3), np.float32)
    light[100] = [1e5, 9e4, 7e4]
    result = model.product(light)
    towards = transport.cube_map.directions[100]
    cosine = transport.normals @ towards
    assert result.min() == 0
    # Where the quadratic 1/4 + c/2 + 5 (3 c^2 - 1) / 32 of a single direction dips below zero.
    polynomial = 0.25 + cosine / 2 + 5 * (3 * cosine**2 - 1) / 32
    dark = polynomial < -0.005
    assert dark.sum() > 20 and not result[dark].any()
    lit = polynomial > 0.005
    power = light[100] * transport.cube_map.solid_angles[100]
    wanted = polynomial[:, None] / np.pi * power
    np.testing.assert_allclose(result[lit], wanted[lit], rtol=0.05, atol=0.01 * wanted.max())


def test_coefficients_are_what_a_light_of_one_harmonic_gives():
    rng = np.random.default_rng(3)
    matrix, coarse, fine = rng.random((5, 24, 3)), CubeMap(2), CubeMap(64)
    # The mean of each harmonic over a texel, by the texels of a finer map.
    values = harmonics(fine.directions, 3) * fine.solid_angles[:, None]
    means = np.zeros((24, 9))
    np.add.at(means, coarse.texel_of(fine.directions), values)
    model = Harmonics(3).fit(ArrayRows(matrix, 2))
    wanted = np.einsum("pdc,dk->pkc", matrix, means / coarse.solid_angles[:, None])
    assert relative(model.coefficients_, wanted) < 1e-3
    light = rng.random((24, 3))
    coefficients = means.T @ light
    assert relative(model.project(light), coefficients) < 1e-3
    wanted = np.einsum("pkc,kc->pc", wanted, coefficients)
    assert relative(model.product(light), wanted) < 1e-3
