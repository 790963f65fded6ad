"""Oren-Nayar, and Lambert without roughness: closed forms, and what roughness does."""

import numpy as np
import pytest

from prt_core.reflectance import Lambert, OrenNayar, directional_albedo
from tests.core.reflectance.directions import hemisphere, towards


def test_lambert_is_albedo_over_pi():
    value = Lambert((0.2, 0.5)).eval(hemisphere(4), hemisphere(4, 1))
    np.testing.assert_allclose(value, np.tile([0.2 / np.pi, 0.5 / np.pi], (4, 1)), rtol=1e-15)


def test_no_roughness_is_lambert():
    incoming, outgoing = hemisphere(100), hemisphere(100, 1)
    for colour in (0.0, 0.5, 1.0):
        value = OrenNayar(colour, 0.0).eval(incoming, outgoing)
        np.testing.assert_allclose(value, Lambert(colour).eval(incoming, outgoing), rtol=1e-12)


@pytest.mark.parametrize("roughness", [0.3, 1.0])
def test_white_furnace(roughness):
    # Fujii's mean is rounded: 5.6 stands for 5.5946.
    for cosine in (0.1, 0.5, 1.0):
        albedo = directional_albedo(OrenNayar(1.0, roughness), towards(cosine))[0]
        assert albedo == pytest.approx(1, abs=2e-3)
    # Colours get darker, as Cycles has them: further bounces take the colour a third time.
    grey = directional_albedo(OrenNayar(0.5, roughness), towards(0.5))[0]
    assert 0.4 < grey < 0.5


def test_rough_surfaces_send_light_back_where_it_came_from():
    lobe, light = OrenNayar(0.8, 1.0), towards(0.4, 0)
    back, away = lobe.eval(light, light)[0], lobe.eval(light, light * [-1, -1, 1])[0]
    assert back > 1.5 * away


def test_values_of_fujii():
    # Facing the light head-on: A = 1 / (pi + s (pi / 2 - 2 / 3)) alone, and what bounces further.
    s, up = 0.6, np.array([0, 0, 1.0])
    a = 1 / (np.pi + s * (np.pi / 2 - 2 / 3))
    most, mean = np.pi / 2 - 2 / 3, (2 * np.pi - 5.6) / 3
    lost, lost_mean = s * a * most, s * a * (most - mean)
    further = 0.25 / np.pi * (1 - lost_mean) / (1 - 0.5 * lost_mean) * lost**2 / lost_mean
    assert OrenNayar(0.5, s).eval(up, up)[0] == pytest.approx(0.5 * (a + further), rel=1e-12)


def test_weight_and_colour_of_facets_are_apart():
    up = np.array([0, 0, 1.0])
    half = OrenNayar(0.25, 0.8, colour=0.5).eval(up, up)
    np.testing.assert_allclose(half, OrenNayar(0.5, 0.8).eval(up, up) / 2, rtol=1e-12)
