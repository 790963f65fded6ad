"""Ashikhmin and Shirley's lobes: their equations."""

import numpy as np
import pytest

from prt_core.reflectance import AshikhminShirley, AshikhminShirleyDiffuse, directional_albedo
from tests.core.reflectance.directions import hemisphere

UP = np.array([0, 0, 1.0])


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
