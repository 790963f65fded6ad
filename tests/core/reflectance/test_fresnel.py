"""Fresnel terms against closed forms, and their means against integrals."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.reflectance import Constant, Dielectric, F82Tint, RealSchlick
from prt_core.reflectance.fresnel import dielectric, f0_of_ior, mean_dielectric

COSINES = np.linspace(0, 1, 4001)


def mean(term):
    """2 times the integral of a term and the cosine, by Gauss and Legendre."""
    places, weights = np.polynomial.legendre.leggauss(200)
    cosine = (places + 1) / 2
    return (term(cosine) * (weights * cosine)[:, None]).sum(axis=0)


@pytest.mark.parametrize("ior", [1.0001, 1.33, 1.5, 2.4, 0.7])
def test_dielectrics_follow_snell_and_fresnel(ior):
    inside = np.sqrt(np.maximum(1 - (1 - COSINES**2) / ior**2, 0))
    with np.errstate(invalid="ignore"):
        across = ((COSINES - ior * inside) / (COSINES + ior * inside)) ** 2
        along = ((inside - ior * COSINES) / (inside + ior * COSINES)) ** 2
    value = dielectric(COSINES, ior)
    np.testing.assert_allclose(value[1:], ((across + along) / 2)[1:], atol=1e-9)
    assert value[0] == 1 and value[-1] == pytest.approx(f0_of_ior(ior), rel=1e-6)


def test_brewster_and_total_reflection():
    ior = 1.5
    angle = np.arctan(ior)
    polarised = ((np.cos(angle) - ior * np.cos(np.pi / 2 - angle)) ** 2) / (
        (np.cos(angle) + ior * np.cos(np.pi / 2 - angle)) ** 2
    )
    assert dielectric(np.cos(angle), ior) == pytest.approx(polarised / 2)
    critical = np.sqrt(1 - 0.7**2)
    assert dielectric(critical - 1e-3, 0.7) == 1 and dielectric(critical + 1e-2, 0.7) < 0.7


def test_no_step_of_the_index_reflects_nothing():
    assert not dielectric(COSINES[1:], 1.0).any()
    schlick = RealSchlick(0.0, 1.0, 1.0)
    assert np.isfinite(schlick(COSINES)).all() and np.isfinite(schlick.mean).all()


@pytest.mark.parametrize("ior", [1.2, 1.5, 2.0])
def test_means_of_dielectrics_are_a_fit(ior):
    # Kulla and Conty's fit, within 0.007 of the integral.
    assert mean(Dielectric(ior))[0] == pytest.approx(mean_dielectric(ior), abs=7e-3)
    schlick = RealSchlick((0.1, 0.2, 0.3), 1.0, ior)
    np.testing.assert_allclose(mean(schlick), schlick.mean, atol=7e-3)


def test_real_schlick_of_its_own_f0_is_the_dielectric():
    for ior in (1.2, 1.5, 2.0):
        schlick = RealSchlick(f0_of_ior(ior), 1.0, ior)
        np.testing.assert_allclose(schlick(COSINES), Dielectric(ior)(COSINES), atol=1e-12)
    assert RealSchlick(3.0, 1.0, 1.5)(np.ones(1)) == 1


def test_metals_meet_their_three_points():
    f0, tint = np.array([0.9, 0.6, 0.2]), np.array([0.5, 1, 0.8])
    term = F82Tint(f0, tint)
    np.testing.assert_allclose(term(np.ones(1))[0], f0)
    np.testing.assert_allclose(term(np.zeros(1))[0], 1)
    schlick = f0 + (1 - f0) * (6 / 7) ** 5
    np.testing.assert_allclose(term(np.full(1, 1 / 7))[0], schlick * tint)
    np.testing.assert_allclose(mean(term), term.mean, atol=1e-3)


def test_half_a_metal_is_half_of_it():
    whole, half = F82Tint((0.9, 0.5, 0.1), 0.4), F82Tint((0.45, 0.25, 0.05), 0.4, 0.5)
    np.testing.assert_allclose(half(COSINES), whole(COSINES) / 2, rtol=1e-12)
    np.testing.assert_allclose(half.mean, whole.mean, rtol=1e-12)
    assert not F82Tint(0.0, 1.0, 0.0)(COSINES).any() and F82Tint(0.0, 1.0, 0.0).mean == 0


def test_shapes_of_parameters_and_channels():
    rng = np.random.default_rng(0)
    cosine = rng.random((5, 7))
    colour, one = rng.random((5, 1, 3)), rng.random((5, 1))
    terms = [Constant(colour), Dielectric(1 + one), RealSchlick(colour, 1.0, 1 + one),
             F82Tint(colour, 0.5)]  # fmt: skip
    for term in terms:
        assert term(cosine).shape == (5, 7, term.n_channels)
        assert term(cosine.astype(np.float32)).dtype == np.float32


def test_wrong_colours_are_said():
    with pytest.raises(PRTError, match="^f0: expected 0 or more, got -1$"):
        F82Tint(-1.0)
    with pytest.raises(PRTError, match="^ior: expected 0 or more, got -1.5$"):
        Dielectric(-1.5)
