"""A world as one image, as bakes with gloss keep it."""

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.light import EnvironmentMap
from prt_core.light.baked_world import image_of_world
from prt_core.light.sky import Sky, with_suns
from prt_core.sphere import CubeMap


def noise(height):
    return np.random.default_rng(3).random((height, 2 * height, 3)).astype(np.float32)


def test_an_image_that_is_not_turned_is_kept_as_it_is():
    pixels = noise(32)
    image = image_of_world(EnvironmentMap(pixels), None, 2.0)
    np.testing.assert_array_equal(image.pixels, 2 * pixels)


def test_a_turned_world_is_turned_in_its_image():
    pixels = noise(32)
    image = image_of_world(EnvironmentMap(pixels), 90.0)
    # A quarter of a turn about z moves columns by a quarter of the width, to the left.
    np.testing.assert_allclose(image.pixels, np.roll(pixels, -16, axis=1), atol=1e-5)


def test_large_images_become_means_of_their_pixels():
    pixels = noise(1024)
    image = image_of_world(EnvironmentMap(pixels))
    means = pixels.reshape(512, 2, 1024, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(image.pixels, means, atol=1e-5)


def test_an_even_world_needs_one_pixel():
    image = image_of_world(EnvironmentMap(np.full((4, 8, 3), 0.5, np.float32)), 20.0, 3.0)
    np.testing.assert_array_equal(image.pixels, np.full((1, 1, 3), 1.5, np.float32))
    np.testing.assert_array_equal(
        Sky(((image, np.eye(3), 1.0),))(noise(4)[0]), np.full((8, 3), 1.5)
    )
    np.testing.assert_allclose(image.to_cube_map(CubeMap(4)), 1.5, rtol=1e-6)
    with pytest.raises(PRTError, match="environment: expected"):
        image_of_world(noise(4))


def test_suns_are_discs_that_bring_what_they_are_said_to():
    towards, angle = np.array([0, 0.6, 0.8]), 0.2
    shown = with_suns(Sky(()), [(towards, np.array([3.0, 2.0, 1.0]), angle)])
    rng = np.random.default_rng(1)
    ways = towards + 0.2 * rng.normal(size=(200_000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    radiance = shown(ways)
    inside = ways @ towards > np.cos(angle / 2)
    assert (radiance[~inside] == 0).all()
    disc = np.array([3, 2, 1]) / (np.pi * np.sin(0.1) ** 2)
    np.testing.assert_allclose(radiance[inside], np.tile(disc, (inside.sum(), 1)), rtol=1e-5)
    assert with_suns(None, [(towards, np.ones(3), angle)]) is None


def test_a_sun_without_width_is_still_seen():
    shown = with_suns(Sky(()), [(np.array([0, 0, 1.0]), np.ones(3), 0.0)])
    assert (
        np.isfinite(shown(np.array([[0, 0, 1.0]]))).all() and shown(np.array([[0, 0, 1.0]])).any()
    )
