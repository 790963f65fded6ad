"""GGX: sliders, white furnace, colours of many bounces, narrow lobes."""

import numpy as np
import pytest

from prt_core.reflectance import (
    SMALLEST_ALPHA,
    Constant,
    Dielectric,
    Microfacet,
    alphas,
    directional_albedo,
    glossy_anisotropy,
)
from tests.core.reflectance.directions import hemisphere, towards


def test_sliders_are_those_of_principled():
    x, y = alphas(0.5, 0.8)
    aspect = np.sqrt(1 - 0.9 * 0.8)
    assert (x, y) == (pytest.approx(0.25 / aspect), pytest.approx(0.25 * aspect))
    assert alphas(0.0) == (SMALLEST_ALPHA, SMALLEST_ALPHA)
    # Wider than a hemisphere there is nothing.
    assert alphas(1.0, 1.0)[0] == 1


@pytest.mark.parametrize("slider", [-0.5, -0.1, 0.0, 0.3, 0.6])
def test_sliders_of_glossy_in_those_of_principled(slider):
    root = 0.4**2
    wanted = (root * (1 - slider), root / (1 - slider)) if slider > 0 else (
        root / (1 + slider), root * (1 + slider))  # fmt: skip
    anisotropy, turned = glossy_anisotropy(slider)
    x, y = alphas(0.4, anisotropy)
    assert ((y, x) if turned else (x, y)) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("roughness", [0.05, 0.2, 0.4, 0.6, 0.8, 1.0])
def test_white_furnace(roughness):
    lobe = Microfacet(*alphas(roughness))
    for cosine in (0.1, 0.3, 0.6, 1.0):
        albedo = directional_albedo(lobe, towards(cosine))[0]
        assert albedo == pytest.approx(1, abs=0.01)
    # Without the light of further bounces a rough lobe loses most of it.
    assert directional_albedo(Microfacet(1, 1, multiple=False), towards(1.0))[0] < 0.35


def test_furnace_of_a_stretched_lobe():
    # Its factor is that of a round lobe of the same area, as in Cycles: a tenth may be missing.
    lobe = Microfacet(*alphas(0.5, 0.8))
    albedo = [directional_albedo(lobe, towards(c, t))[0] for c in (0.2, 1.0) for t in (0, 0.8, 1.6)]
    assert 0.89 < min(albedo) < 0.91 and 1.01 < max(albedo) < 1.03


def test_further_bounces_make_colours_deeper():
    outgoing = towards(0.8)
    gain = Microfacet(1, 1, Constant((0.2, 0.5, 1))).gain(outgoing)
    single = Microfacet(1, 1, multiple=False)
    albedo = directional_albedo(single, outgoing)[0]
    assert (np.diff(gain) > 0).all() and gain[2] == pytest.approx(1 / albedo, rel=5e-3)
    assert Microfacet(1, 1, Constant(0.0)).gain(outgoing) == 1
    darkening = Microfacet(1, 1, Constant((0.2, 0.5, 1))).darkening(outgoing)
    np.testing.assert_allclose(darkening, gain / gain[2], rtol=1e-12)


def test_peaks_of_narrow_lobes_in_single_precision():
    for alpha in (1e-4, 1e-3, 1e-2):
        lobe, outgoing = Microfacet(alpha, alpha), towards(0.6).astype(np.float32)
        peak = lobe.eval(outgoing * np.float32([-1, -1, 1]), outgoing)[0]
        # D / 4 cos^2 at the mirror direction, all light unmasked.
        assert peak == pytest.approx(1 / (4 * np.pi * alpha**2 * 0.36), rel=2e-2)
    # Smaller is taken as the smallest, not as nothing.
    zero, least = Microfacet(0, 0), Microfacet(SMALLEST_ALPHA, SMALLEST_ALPHA)
    incoming, outgoing = hemisphere(5), hemisphere(5, 8)
    np.testing.assert_array_equal(zero.eval(incoming, outgoing), least.eval(incoming, outgoing))


def test_a_lobe_is_stretched_along_its_tangent():
    lobe = Microfacet(*alphas(0.4, 0.9))
    up, step = np.array([0, 0, 1.0]), 0.15
    along = np.array([np.sin(step), 0, np.cos(step)])
    across = np.array([0, np.sin(step), np.cos(step)])
    assert lobe.eval(along, up)[0] > 3 * lobe.eval(across, up)[0]
    assert lobe.roughness == pytest.approx(0.4)


def test_colours_of_terms_are_channels():
    assert Microfacet(0.2, 0.2).n_channels == 1
    lobe = Microfacet(0.2, 0.2, Constant((0.1, 0.2, 0.3)))
    value = lobe.eval(towards(0.9), towards(0.9))
    assert value.shape == (3,) and lobe.n_channels == 3
    glass = Microfacet(0.2, 0.2, Dielectric(1.5))
    assert glass.eval(towards(0.9), towards(0.9)).shape == (1,)
