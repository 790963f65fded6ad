"""The sun of an image as a lamp: samples spread evenly over its pixels, by their power."""

import numpy as np
import pytest

from prt_core.light import EnvironmentMap, split_sun
from prt_core.sphere import rotation_matrix

TURN = (20.0, -50.0, 130.0)


def sunny():
    pixels = np.full((32, 64, 3), 0.1, np.float32)
    pixels[3, 10], pixels[3, 11], pixels[20, 40] = (90, 60, 30), (300, 400, 100), (5, 10, 800)
    return pixels


def edges_of(row):
    return np.cos(np.array([row, row + 1]) / 32 * np.pi)


@pytest.mark.parametrize("turn", [None, TURN])
def test_samples_lie_in_the_pixels_as_often_as_they_have_power(turn):
    pixels, strength = sunny(), 1.5
    rest, sun = split_sun(EnvironmentMap(pixels), turn, strength)
    assert not sun.is_small
    count = np.arange(40_000)
    uv = np.stack([(count + 0.5) / len(count), count * (np.sqrt(5) - 1) / 2 % 1], axis=1)
    direction, distance, irradiance = sun.sample(np.zeros((len(uv), 3)), uv)
    assert np.isinf(distance).all()
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, rtol=1e-12)
    # Turned back, and looked up: +x is the middle column, +y is left of it.
    x, y, z = (direction @ rotation_matrix(turn)).T
    column = (0.5 - np.arctan2(y, x) / (2 * np.pi)) * 64
    row = np.arccos(z) / np.pi * 32
    total = 0.0
    powers = {}
    for place in ((3, 10), (3, 11), (20, 40)):
        top, bottom = edges_of(place[0])
        above = (pixels[place] - rest.pixels[place]).astype(np.float64) * strength
        powers[place] = above * (top - bottom) * 2 * np.pi / 64
        total = total + powers[place].sum()
    for place, power in powers.items():
        inside = (np.floor(row) == place[0]) & (np.floor(column) == place[1])
        assert inside.mean() == pytest.approx(power.sum() / total, abs=0.01)
        np.testing.assert_allclose(
            irradiance[inside].sum(axis=0) / len(uv), power, rtol=0.02, atol=0.01
        )
        # Evenly over its area: by angle across, by height upwards.
        top, bottom = edges_of(place[0])
        for part in ((column[inside] - place[1]), (z[inside] - bottom) / (top - bottom)):
            assert part.min() >= 0 and part.max() <= 1
            assert np.abs(np.sort(part) - np.linspace(0, 1, inside.sum())).max() < 0.02
    # By power, so that every sample brings as much and none is a surprise.
    np.testing.assert_allclose(irradiance.sum(axis=1), total, rtol=1e-7)
    np.testing.assert_allclose(sun.power, sum(powers.values()), rtol=1e-7)


def test_what_is_fifty_times_the_mean_over_the_sphere_is_a_sun():
    # At the pole a pixel is small: the mean over the sphere is not that over the pixels.
    pixels = sunny()
    edges = np.cos(np.arange(33) / 32 * np.pi)
    weight = (edges[:-1] - edges[1:]) / 2
    mean = (pixels.astype(np.float64).mean(axis=(1, 2)) * weight).sum()
    rest, sun = split_sun(EnvironmentMap(pixels))
    assert rest.pixels.max() == pytest.approx(50 * mean, rel=1e-6)
    bright = pixels.max(axis=-1) > 50 * mean
    np.testing.assert_array_equal(np.stack([sun.rows, sun.columns]), np.nonzero(bright))
    np.testing.assert_array_equal(rest.pixels[~bright], pixels[~bright])
    # What is left of it has its colour.
    np.testing.assert_allclose(
        rest.pixels[3, 11] / rest.pixels[3, 11].max(), [0.75, 1, 0.25], rtol=1e-6
    )
    np.testing.assert_allclose(
        sun.radiance, (pixels[bright] - rest.pixels[bright]).astype(np.float64)
    )
