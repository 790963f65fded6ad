"""Phong's lobe: closed forms."""

import numpy as np
import pytest

from prt_core.reflectance import AshikhminShirley, Lambert, Phong, Sum, directional_albedo
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


def test_roughness_of_the_same_width():
    # Near their peaks they fall as a GGX lobe of that roughness does.
    for lobe in (Phong(200), AshikhminShirley(400, 800)):
        alpha = lobe.roughness**2
        turn = 0.3 * alpha
        incoming = np.array([0, np.sin(2 * turn), np.cos(2 * turn)])
        ratio = lobe.eval(incoming, UP)[0] / lobe.eval(UP, UP)[0]
        ggx = 1 / (1 + (np.tan(turn) / alpha) ** 2) ** 2
        assert ratio == pytest.approx(ggx, rel=0.02)
