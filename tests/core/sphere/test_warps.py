"""Warps fall as densely as they say; frames are right-handed; the hemisphere is a square."""

import numpy as np
import pytest

from prt_core.sphere import (
    cone_density,
    cosine_density,
    cosine_power,
    cosine_power_density,
    disc_density,
    ggx_density,
    ggx_normal_density,
    hemisphere_directions,
    hemisphere_solid_angle,
    hemisphere_square,
    square_to_cone,
    square_to_cosine,
    square_to_cosine_power,
    square_to_disc,
    square_to_ggx_normals,
    tangent_frames,
    tangents,
)
from tests.chi_squared import chi_squared, integral

N = 400


def stratified(dtype=np.float64):
    """(N^2, 2) middles of the cells of an even grid."""
    places = (np.arange(N) + 0.5) / N
    return (
        np.stack(np.meshgrid(places, places, indexing="ij"), axis=-1).reshape(-1, 2).astype(dtype)
    )


# A few functions whose integrals tell a wrong density, one of them without symmetry.
def height(directions):
    return directions[..., 2]


def lopsided(directions):
    return np.exp(0.7 * directions[..., 0] - 0.4 * directions[..., 1]) * directions[..., 2] ** 3


def hemisphere_integral(function, lowest=0.0):
    """Over the solid angle above a height, by the midpoint rule in height and angle."""
    z = lowest + (1 - lowest) * (np.arange(1500) + 0.5) / 1500
    angle = 2 * np.pi * (np.arange(360) + 0.5) / 360
    z, angle = np.meshgrid(z, angle, indexing="ij")
    flat = np.sqrt(1 - z**2)
    values = function(np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=-1))
    return values.mean() * 2 * np.pi * (1 - lowest)


def one(directions):
    return np.ones(directions.shape[:-1])


@pytest.mark.parametrize("function", [one, height, lopsided])
def test_the_mean_over_a_warp_divided_by_its_density_is_the_integral(function):
    if function is not one:
        # Where the density goes to 0 and the function does not, the mean needs more samples.
        cosine = square_to_cosine(stratified())
        result = (function(cosine) / cosine_density(cosine[:, 2])).mean()
        assert result == pytest.approx(hemisphere_integral(function), rel=3e-3)
    for cap in (1e-3, 0.4, 1.0):
        cone = square_to_cone(stratified(), cap)
        result = (function(cone) / cone_density(cap)).mean()
        assert result == pytest.approx(hemisphere_integral(function, 1 - cap), rel=1e-3)


def test_discs_are_even():
    places = square_to_disc(stratified())
    radius = np.linalg.norm(places, axis=1)
    assert radius.max() < 1
    for x, y, r in ((0.3, -0.2, 0.5), (-0.5, 0.4, 0.2)):
        share = (np.linalg.norm(places - [x, y], axis=1) < r).mean()
        assert share == pytest.approx(np.pi * r**2 * disc_density(), rel=0.01)


@pytest.mark.parametrize("exponents", [(0, 0), (1, 1), (10, 100), (3000, 5)])
def test_powers_of_the_cosine_fall_as_densely_as_they_say(exponents):
    pole = [0, 0, 1]
    p, share = chi_squared(
        lambda uv: square_to_cosine_power(uv, *exponents),
        lambda d: cosine_power_density(d, *exponents), pole,
    )  # fmt: skip
    assert p > 1e-3 and share == pytest.approx(1, abs=1e-4)
    assert not cosine_power(np.array([[0.6, 0, -0.8], [1, 0, 0]]), *exponents).any()


def test_the_first_power_is_the_cosine():
    uv = stratified()
    np.testing.assert_allclose(square_to_cosine_power(uv, 1), square_to_cosine(uv), atol=1e-9)
    directions = square_to_cosine(uv)
    density = cosine_power_density(directions, 1)
    np.testing.assert_allclose(density, cosine_density(directions[:, 2]), rtol=1e-9)


VIEWS = np.array([[0, 0, 1], [0.6, 0, 0.8], [-0.4, 0.88, 0.256125]])


@pytest.mark.parametrize("alphas", [(1, 1), (0.3, 0.3), (0.02, 0.4)])
@pytest.mark.parametrize("view", VIEWS)
def test_visible_normals_fall_as_densely_as_they_say(alphas, view):
    view = view / np.linalg.norm(view)
    p, share = chi_squared(
        lambda uv: square_to_ggx_normals(uv, view, *alphas),
        lambda d: ggx_normal_density(d, view, *alphas), [0, 0, 1],
    )  # fmt: skip
    assert p > 1e-3 and share == pytest.approx(1, abs=5e-3)


@pytest.mark.parametrize("alphas", [(1, 1), (0.3, 0.3), (0.05, 0.4)])
def test_facets_cover_the_surface_once(alphas):
    area = integral(lambda d: ggx_density(d, *alphas) * np.maximum(d[:, 2], 0), [0, 0, 1])
    assert area == pytest.approx(1, abs=1e-4)
    # Normals of any length are the same.
    normals = square_to_cosine(stratified())[:50]
    np.testing.assert_allclose(ggx_density(3 * normals, *alphas), ggx_density(normals, *alphas))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_warps_keep_the_precision_and_shape(dtype):
    uv = stratified(dtype)[:6].reshape(2, 3, 2)
    for warp, last in ((square_to_disc, 2), (square_to_cosine, 3)):
        assert warp(uv).dtype == dtype and warp(uv).shape == (2, 3, last)
    assert square_to_cone(uv, dtype(0.3)).dtype == dtype
    view = np.array([0, 0.6, 0.8], dtype)
    for alpha in (0.2, np.full((2, 3), 0.2)):
        assert square_to_cosine_power(uv, alpha).dtype == dtype
        normals = square_to_ggx_normals(uv, view, alpha, alpha)
        assert normals.dtype == dtype and normals.shape == (2, 3, 3)


def test_narrow_cones_stay_narrow():
    cone = square_to_cone(stratified(), 1e-12)
    away = np.hypot(cone[:, 0], cone[:, 1])
    # The half angle of a cap of 1e-12 is its root times that of two.
    assert away.max() == pytest.approx(np.sqrt(2e-12), rel=0.02)


@pytest.mark.parametrize("seed", [0, 1])
def test_frames_are_right_handed_and_turn_z_into_the_normal(seed):
    normals = np.random.default_rng(seed).normal(size=(500, 3))
    normals[:6] = [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0], [1e-9, 0, -1], [1, 1, 1e-12]]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    u, v = tangents(normals)
    frames = tangent_frames(normals)
    np.testing.assert_array_equal(frames, np.stack([u, v, normals], axis=1))
    np.testing.assert_allclose(frames @ frames.swapaxes(1, 2), np.tile(np.eye(3), (500, 1, 1)),
                               atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(np.cross(u, v), normals, atol=1e-12)


@pytest.mark.parametrize(("width", "height"), [(4, 4), (5, 8), (32, 16)])
def test_texels_of_the_hemisphere_have_the_same_solid_angle(width, height):
    # How many of even directions fall into each texel.
    z = (np.arange(900) + 0.5) / 900
    angle = 2 * np.pi * (np.arange(900) + 0.317) / 900
    z, angle = np.meshgrid(z, angle, indexing="ij")
    flat = np.sqrt(1 - z**2)
    u, v = hemisphere_square(np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=-1))
    assert u.min() >= 0 and u.max() <= 1 and v.min() >= 0 and v.max() <= 1
    counts = np.histogram2d(u.ravel(), v.ravel(), (width, height), [[0, 1], [0, 1]])[0]
    solid_angles = counts / z.size * 2 * np.pi
    np.testing.assert_allclose(solid_angles, hemisphere_solid_angle(width, height), rtol=0.05)


def test_the_hemisphere_and_the_square_undo_each_other():
    u, v = stratified().T
    directions = hemisphere_directions(u, v)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, atol=1e-12)
    assert directions[:, 2].min() >= 0
    np.testing.assert_allclose(hemisphere_square(directions), [u, v], atol=1e-9)
    # The middle is the pole, the border the horizon, sides along the axes.
    np.testing.assert_allclose(hemisphere_directions(0.5, 0.5), [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(hemisphere_directions(1.0, 0.5), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(hemisphere_directions(0.5, 0.0), [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(hemisphere_directions(0.0, 0.0)[:2], [-(0.5**0.5)] * 2, atol=1e-12)
    for pole in ([0.0, 0, 1], [0.0, -0.0, 1]):
        np.testing.assert_allclose(hemisphere_square(np.array(pole)), [0.5, 0.5], atol=1e-12)
    # Neighbours in the square are neighbours on the sphere, across the diagonals too.
    step = np.linalg.norm(hemisphere_directions(u + 1e-6, v) - directions, axis=-1)
    assert step.max() < 1e-5
