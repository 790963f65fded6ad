"""Light on bent normals, against Cycles' own figures and its mean against a dense sum."""

import numpy as np

from prt_core.reflectance.bump import bump_mean, bump_shadowing, bump_strength


def test_light_is_dimmed_as_cycles_dims_it():
    """A normal bent by 44.4 degrees under suns at 30, 50 and 70 degrees, baked by Cycles 5.0."""
    strength = bump_strength(0.71487)
    baked = np.array([0.5496106, 0.54783344, 0.43418923])
    even = np.array([0.5550352, 0.5701866, 0.5165652])
    cosine = np.cos(np.radians([30, 50, 70]))
    np.testing.assert_allclose(bump_shadowing(strength, cosine), baked / even, rtol=2e-4)
    np.testing.assert_allclose(bump_shadowing(0.0, cosine), 1)
    np.testing.assert_allclose(bump_shadowing(strength, [1.0, 1e-9]), [1, 0], atol=1e-4)


def test_the_mean_is_that_of_an_even_sky():
    rng = np.random.default_rng(5)
    z, turn = rng.random(200_000), rng.random(200_000) * 2 * np.pi
    x = np.sqrt(1 - z * z) * np.cos(turn)
    for bend in (0.0, 20.0, 44.4, 66.0):
        c, s = np.cos(np.radians(bend)), np.sin(np.radians(bend))
        strength = bump_strength(c)
        light = np.maximum(x * s + z * c, 0)
        wanted = (light * bump_shadowing(strength, z)).sum() / light.sum()
        np.testing.assert_allclose(bump_mean(strength), wanted, rtol=5e-3)
