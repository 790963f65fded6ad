"""Light on texels against dense quadrature, and where directions fall that lie on an edge."""

from itertools import product

import numpy as np
import pytest

from prt_core.light import EnvironmentMap, TurningLight, sun_light
from prt_core.sphere import CubeMap, rotation_matrix

TURN = (20.0, -50.0, 130.0)


def quadrature(cube_map, function, n=24):
    """Mean of a function of directions over each texel, by n x n places weighted by solid angle."""
    fine = CubeMap(cube_map.resolution * n)
    group = cube_map.texel_of(fine.directions)
    values = function(fine.directions) * fine.solid_angles[:, None]
    return np.stack(
        [np.bincount(group, column) / cube_map.solid_angles for column in values.T], axis=1
    )


@pytest.mark.parametrize("resolution", [1, 2, 7, 16])
def test_directions_along_edges_and_corners_fall_into_a_texel_that_touches_them(resolution):
    cube_map = CubeMap(resolution)
    places = np.array([p for p in product((-1, 0, 1, 0.37), repeat=3) if any(p)])
    texels = cube_map.texel_of(places)
    centres = cube_map.directions[texels]
    # In the texel's face, within half a texel of its centre.
    for place, centre in zip(places, centres, strict=True):
        axis = np.abs(centre).argmax()
        assert place[axis] * centre[axis] > 0
        on_face = place / np.abs(place[axis]) - centre / np.abs(centre[axis])
        assert np.abs(on_face).max() <= 1 / resolution + 1e-9


def sky(ways):
    """A smooth sky without any symmetry, of three colours."""
    x, y, z = ways.T
    one, two = np.sin(3 * x + 2 * y - z), np.cos(4 * y * z + x)
    return np.stack([1.5 + one, 2 + two + 0.5 * one, 1.2 + 0.6 * two * z], axis=1)


def image_of(function, height):
    """Pixels of a function of directions, where Cycles looks them up: +x is the middle column,
    +y a quarter left of it, +z the top row."""
    polar = (np.arange(height) + 0.5) / height * np.pi
    angle = np.pi - (np.arange(2 * height) + 0.5) / height * np.pi
    ways = [np.outer(np.sin(polar), part(angle)) for part in (np.cos, np.sin)]
    ways.append(np.outer(np.cos(polar), np.ones(2 * height)))
    ways = np.stack(ways, axis=-1).reshape(-1, 3)
    return function(ways).reshape(height, 2 * height, 3).astype(np.float32)


@pytest.mark.parametrize("turn", [None, TURN])
@pytest.mark.parametrize("height", [48, 512])
def test_a_texel_has_the_mean_of_what_it_shows(height, turn):
    environment = EnvironmentMap(image_of(sky, height))
    assert environment.layers[1] is None
    cube_map, matrix = CubeMap(12), rotation_matrix(turn)
    # The light is turned: what lies in a direction was in the one turned back.
    wanted = quadrature(cube_map, lambda ways: sky(ways @ matrix), 12)
    result = environment.to_cube_map(cube_map, turn, 1.5)
    np.testing.assert_allclose(result, 1.5 * wanted, rtol=0.05)
    assert np.linalg.norm(result / 1.5 - wanted) < 0.008 * np.linalg.norm(wanted)
    # Parts at a texel's rim are not cut.
    np.testing.assert_allclose(TurningLight(environment, cube_map).at(turn), wanted, rtol=0.06)
    looked_up = environment.sample(cube_map.directions @ matrix)
    np.testing.assert_allclose(looked_up, sky(cube_map.directions @ matrix), rtol=0.15)


def test_thinning_out_an_image_weighs_its_rows_by_area():
    # Rows in turn black and white: near the poles the one nearer to the equator is the larger.
    pixels = np.zeros((512, 1024, 3), np.float32)
    pixels[1::2] = 1
    (rows, columns, shape, values), bright = EnvironmentMap(pixels).layers
    assert bright is None and shape == (256, 512)
    np.testing.assert_array_equal(rows * 512 + columns, np.arange(256 * 512))
    edges = np.cos(np.arange(513) / 512 * np.pi)
    for row in (0, 1, 100, 200, 255):
        area = edges[2 * row : 2 * row + 2] - edges[2 * row + 1 : 2 * row + 3]
        np.testing.assert_allclose(values[rows == row], area[1] / area.sum(), rtol=1e-5)
    assert values[0, 0] == pytest.approx(0.75, abs=1e-3)


@pytest.mark.parametrize("turn", [None, TURN])
def test_small_sources_are_where_they_were(turn):
    pixels = np.full((64, 128, 3), 0.2, np.float32)
    pixels[9:12, 20:23], pixels[40, 100] = (900, 400, 100), (10, 500, 3000)
    environment, cube_map = EnvironmentMap(pixels), CubeMap(4)
    matrix = rotation_matrix(turn)
    wanted = quadrature(cube_map, lambda ways: environment.sample(ways @ matrix), 100)
    result = environment.to_cube_map(cube_map, turn)
    turned = TurningLight(environment, cube_map).at(turn)
    scale = wanted.max(axis=0)
    np.testing.assert_allclose(result / scale, wanted / scale, atol=0.05)
    np.testing.assert_allclose(turned / scale, wanted / scale, atol=0.05)


@pytest.mark.parametrize("angle", [0.6, 1.7, np.pi])
def test_a_sun_on_texels_is_a_disc_of_even_radiance(angle):
    cube_map, towards = CubeMap(6), np.array([0.36, -0.48, 0.8])
    radiance = np.array([3, 2, 1]) / (np.pi * np.sin(angle / 2) ** 2)
    wanted = quadrature(
        cube_map, lambda ways: (ways @ towards > np.cos(angle / 2))[:, None] * radiance, 60
    )
    result = sun_light(cube_map, 2.5 * towards, [3, 2, 1], angle)
    np.testing.assert_allclose(result, wanted, atol=0.03 * radiance[0])


@pytest.mark.parametrize("turn", [13])
def test_many_small_sources_turn_with_their_power_the_brightest_to_the_texel(turn):
    rng = np.random.default_rng(0)
    pixels = np.full((64, 128, 3), 0.01, np.float32)
    places = rng.choice(64 * 128, 900, replace=False)
    pixels.reshape(-1, 3)[places] = rng.uniform(2, 4, (900, 3))
    hot = places[:9]
    pixels.reshape(-1, 3)[hot] = rng.uniform(30, 90, (9, 3))
    environment, cube_map = EnvironmentMap(pixels), CubeMap(16)
    assert len(environment.layers[1][0]) > 384
    result = TurningLight(environment, cube_map).at(turn)
    wanted = environment.to_cube_map(cube_map, turn)
    power = [cube_map.solid_angles @ light for light in (result, wanted)]
    np.testing.assert_allclose(*power, rtol=1e-3)
    np.testing.assert_allclose(result, wanted, atol=0.02 * wanted.max())
    dim = wanted.max(axis=1) < 0.1 * wanted.max()
    assert np.linalg.norm(result[dim] - wanted[dim]) < 0.15 * np.linalg.norm(wanted[dim])
