"""Phong's lobe and Ashikhmin and Shirley's: closed forms."""

import numpy as np
import pytest

from prt_core.reflectance import (
    AshikhminShirley,
    AshikhminShirleyDiffuse,
    Lambert,
    Phong,
    Sum,
    directional_albedo,
)
from tests.core.reflectance.directions import hemisphere, towards

UP = np.array([0, 0, 1.0])


@pytest.mark.parametrize("exponent", [0, 1, 10, 500, 1e5])
def test_phong_keeps_all_light_from_straight_on(exponent):
    lobe = Phong(exponent)
    assert directional_albedo(lobe, UP)[0] == pytest.approx(1, abs=1e-3)
    assert lobe.eval(UP, UP)[0] == pytest.approx((exponent + 2) / (2 * np.pi))
    outgoing = towards(0.5)
    away = hemisphere(50)
    cosine = np.maximum((away * outgoing * [-1, -1, 1]).sum(axis=1), 0)
    expected = np.where(cosine > 0, (exponent + 2) / (2 * np.pi) * cosine**exponent, 0)
    np.testing.assert_allclose(lobe.eval(away, outgoing)[:, 0], expected, rtol=1e-4, atol=1e-9)


def test_half_diffuse():
    lobe = Sum([Lambert(0.5), Phong(10, 0.5)])
    assert directional_albedo(lobe, UP)[0] == pytest.approx(1, abs=1e-3)


def test_ashikhmin_shirley_by_its_equation():
    x, y, f0 = 10.0, 100.0, 0.3
    lobe, incoming, outgoing = AshikhminShirley(x, y, f0), hemisphere(200), hemisphere(200, 4)
    half = incoming + outgoing
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    cosine = (half * incoming).sum(axis=1)
    power = (x * half[:, 0] ** 2 + y * half[:, 1] ** 2) / (1 - half[:, 2] ** 2)
    expected = np.sqrt((x + 1) * (y + 1)) / (8 * np.pi) * half[:, 2] ** power
    expected /= cosine * np.maximum(incoming[:, 2], outgoing[:, 2])
    expected *= f0 + (1 - f0) * (1 - cosine) ** 5
    np.testing.assert_allclose(lobe.eval(incoming, outgoing)[:, 0], expected, rtol=1e-9)


def test_equal_exponents_have_no_direction():
    lobe, incoming, outgoing = AshikhminShirley(20, 20), hemisphere(50), hemisphere(50, 4)
    turn = np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]])
    np.testing.assert_allclose(lobe.eval(incoming @ turn, outgoing @ turn),
                               lobe.eval(incoming, outgoing), rtol=1e-9)  # fmt: skip


def test_diffuse_below_a_specular_lobe():
    lobe = AshikhminShirleyDiffuse(1.0, 0.0)
    # Equation 5 with its two factors at straight on: 1 - (1 / 2)^5 each.
    assert lobe.eval(UP, UP)[0] == pytest.approx(28 / (23 * np.pi) * (31 / 32) ** 2)
    assert directional_albedo(lobe, UP)[0] == pytest.approx(31 / 32, abs=1e-3)


def test_roughness_of_the_same_width():
    # Near their peaks they fall as a GGX lobe of that roughness does.
    for lobe in (Phong(200), AshikhminShirley(400, 800)):
        alpha = lobe.roughness**2
        turn = 0.3 * alpha
        incoming = np.array([0, np.sin(2 * turn), np.cos(2 * turn)])
        ratio = lobe.eval(incoming, UP)[0] / lobe.eval(UP, UP)[0]
        ggx = 1 / (1 + (np.tan(turn) / alpha) ** 2) ** 2
        assert ratio == pytest.approx(ggx, rel=0.02)
