import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from prt_core import PRTError
from prt_core.light import (
    EnvironmentMap,
    TurningLight,
    split_sun,
    sun_light,
)
from prt_core.light.environment import equirectangular
from prt_core.sphere import CubeMap, rotation_about_z, rotation_matrix


def power(light, cube_map):
    return (light * cube_map.solid_angles[:, None]).sum(axis=0)


def test_an_even_sky_stays_even():
    light = EnvironmentMap(np.full((16, 32, 3), 2.5, np.float32)).to_cube_map(CubeMap(11))
    np.testing.assert_allclose(light, 2.5, rtol=1e-6)


def test_texels_that_only_add_detail_are_cut_into_fewer_parts_but_none_is_left_dark():
    pixels = np.full((16, 32, 3), 2.5, np.float32)
    pixels[5, 3] = 400
    image, cube_map = EnvironmentMap(pixels), CubeMap(64)
    light, whole = (image.to_cube_map(cube_map, 13.0, finer=finer) for finer in (4, 1))
    np.testing.assert_allclose(power(light, cube_map), power(whole, cube_map), rtol=1e-3)
    assert 0 < np.abs(light - whole).max()
    # At corners of faces texels are smallest.
    even = EnvironmentMap(np.full((16, 32, 3), 2.5, np.float32))
    light = even.to_cube_map(CubeMap(128), 13.0, finer=4)
    np.testing.assert_allclose(light, 2.5, rtol=1e-6)


@pytest.mark.parametrize("row", [0, 17, 63])
def test_a_sun_of_one_pixel_keeps_its_power(row):
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[row, 31] = [1e5, 2e4, 3.0]
    top, bottom = (np.sin(np.pi / 2 - r / 64 * np.pi) for r in (row, row + 1))
    wanted = pixels[row, 31] * (top - bottom) * 2 * np.pi / 128
    cube_map = CubeMap(32)
    light = EnvironmentMap(pixels).to_cube_map(cube_map, rotation=12.3)
    np.testing.assert_allclose(power(light, cube_map), wanted, rtol=1e-5)
    assert (light.any(axis=1)).sum() < 80


def test_a_sun_in_a_dim_sky_keeps_both():
    pixels = np.full((64, 128, 3), 0.1, np.float32)
    pixels[20, 40] = 1e5
    cube_map = CubeMap(8)
    light = EnvironmentMap(pixels).to_cube_map(cube_map)
    area = (np.sin(np.pi / 2 - 20 / 64 * np.pi) - np.sin(np.pi / 2 - 21 / 64 * np.pi)) / 64 * np.pi
    np.testing.assert_allclose(power(light, cube_map), 1e5 * area + 0.1 * 4 * np.pi, rtol=1e-4)
    assert abs(np.median(light) - 0.1) < 1e-4


def test_lookup_puts_the_image_where_cycles_does():
    # Blue straight ahead (-x is the middle of the image's right border … +x its centre).
    u, v = equirectangular(np.array([[1.0, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]))
    np.testing.assert_allclose(u[:3], [0.5, 0.25, 0.75])
    np.testing.assert_allclose(v, [0.5, 0.5, 0.5, 1, 0])


def test_cube_map_and_lookup_agree():
    rng = np.random.default_rng(1)
    environment = EnvironmentMap(rng.random((8, 16, 3), np.float32))
    cube_map = CubeMap(64)
    light = environment.to_cube_map(cube_map)
    centre = environment.sample(cube_map.directions)
    # Only texels cut by a pixel's edge differ.
    assert (np.abs(light - centre).max(axis=1) > 1e-3).mean() < 0.2


def test_between_the_middles_of_pixels_an_image_is_linear():
    rng = np.random.default_rng(1)
    environment = EnvironmentMap(rng.random((4, 8, 3), np.float32))

    def along(column, row):
        longitude, latitude = np.pi * (1 - column / 4), np.pi * (0.5 - row / 4)
        flat = np.cos(latitude)
        way = [flat * np.cos(longitude), flat * np.sin(longitude), np.sin(latitude)]
        return environment.interpolated(np.array([way]))[0]

    pixels = environment.pixels
    np.testing.assert_allclose(along(2.5, 1.5), pixels[1, 2], rtol=1e-5)
    quarter = 0.75 * pixels[1, 2] + 0.25 * pixels[1, 3]
    np.testing.assert_allclose(along(2.75, 1.5), quarter, rtol=1e-5)
    # The image goes on at its border, and ends at the poles.
    np.testing.assert_allclose(along(8, 2), pixels[1:3, [0, 7]].mean(axis=(0, 1)), rtol=1e-5)
    np.testing.assert_allclose(along(3.5, 0.1), pixels[0, 3], rtol=1e-5)


@pytest.mark.parametrize("degrees", [0, 30, -90, 180])
def test_rotation_turns_the_light_about_z(degrees):
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[22, 40] = 100
    cube_map = CubeMap(32)
    environment = EnvironmentMap(pixels)
    plain, turned = (
        environment.to_cube_map(cube_map, r)[:, 0] * cube_map.solid_angles for r in (None, degrees)
    )
    mean = plain @ cube_map.directions, turned @ cube_map.directions
    moved = rotation_about_z(degrees) @ mean[0]
    np.testing.assert_allclose(mean[1] / np.linalg.norm(mean[1]), moved / np.linalg.norm(moved),
                               atol=0.02)  # fmt: skip


def test_rotations_of_every_form():
    np.testing.assert_allclose(rotation_matrix([0, 0, 33]), rotation_about_z(33), atol=1e-12)
    np.testing.assert_allclose(rotation_matrix(rotation_about_z(33)), rotation_about_z(33))
    euler = Rotation.from_euler("xyz", [20, -50, 133], degrees=True).as_matrix()
    np.testing.assert_allclose(rotation_matrix([20, -50, 133]), euler, atol=1e-15)
    with pytest.raises(PRTError, match="turns without scaling"):
        rotation_matrix(np.diag([1, 1, -1.0]))


@pytest.mark.parametrize("angle", [0.0, 0.009, 0.5])
def test_a_surface_that_faces_the_sun_gets_its_irradiance(angle):
    cube_map, towards = CubeMap(32), np.array([0.3, -0.4, 0.8])
    light = sun_light(cube_map, towards, [3, 2, 1], angle)
    received = np.einsum("dc,dx,x->c", light, cube_map.vectors, towards / np.linalg.norm(towards))
    np.testing.assert_allclose(received, [3, 2, 1], rtol=2e-3)


@pytest.mark.parametrize("shape", [(1, 1), (2, 4)])
def test_one_colour_is_the_same_from_everywhere(shape):
    pixels = np.full((*shape, 3), (3, 0, 1e5), np.float32)
    result = EnvironmentMap(pixels).to_cube_map(CubeMap(8), (10, 20, 30), 0.5)
    np.testing.assert_allclose(result, np.full((384, 3), (1.5, 0, 5e4)), rtol=1e-6)


def test_bad_pixels_are_refused():
    with pytest.raises(PRTError, match="NaN or infinite"):
        EnvironmentMap(np.full((2, 4, 3), np.nan, np.float32))
    with pytest.raises(PRTError, match="radiance expected >= 0"):
        EnvironmentMap(np.full((2, 4, 3), -1, np.float32))


def test_a_trace_of_negative_radiance_is_cut_and_more_is_refused(monkeypatch):
    pixels = np.full((4, 8, 3), 0.01, np.float32)
    pixels[1, 1], pixels[2, 2] = 100, -0.01
    monkeypatch.setattr("prt_core.light.environment.read_picture", lambda _: (pixels, []))
    assert EnvironmentMap.read("night.exr").pixels.min() == 0
    pixels[2, 2] = -1
    with pytest.raises(PRTError, match="smallest value is -1"):
        EnvironmentMap.read("night.exr")


@pytest.mark.parametrize("turn", [None, 37.0, (20.0, -50.0, 130.0)])
def test_a_turning_light_is_the_light_on_the_texels(turn):
    """Suns keep their texels, a sky its evenness, and all its power."""
    rng = np.random.default_rng(4)
    pixels = rng.random((128, 256, 3)).astype(np.float32)
    pixels[30:34, 60:63] = rng.random((4, 3, 3)) * 1e4
    cube_map, environment = CubeMap(16), EnvironmentMap(pixels)
    result = TurningLight(environment, cube_map).at(turn)
    wanted = environment.to_cube_map(cube_map, turn)
    assert np.linalg.norm(result - wanted) < 5e-3 * np.linalg.norm(wanted)
    power = [cube_map.solid_angles @ light for light in (result, wanted)]
    np.testing.assert_allclose(*power, rtol=2e-3)
    even = EnvironmentMap(np.full((64, 128, 3), 0.5, np.float32))
    np.testing.assert_allclose(TurningLight(even, cube_map).at(turn), 0.5, rtol=1e-6)


@pytest.mark.parametrize("turn", [None, 70])
def test_the_sun_taken_out_is_what_the_map_loses(turn):
    rng = np.random.default_rng(0)
    pixels = rng.random((64, 128, 3)).astype(np.float32)
    pixels[20, 30:32] = [[4e3, 3e3, 2e3], [1e3, 2e3, 9e3]]
    environment, cube_map = EnvironmentMap(pixels), CubeMap(16)
    rest, sun = split_sun(environment, turn, 2.0)
    assert rest.pixels.max() < 200 and len(sun.rows) == 2
    lost = environment.to_cube_map(cube_map, turn, 2.0) - rest.to_cube_map(cube_map, turn, 2.0)
    np.testing.assert_allclose(power(lost, cube_map), sun.power, rtol=1e-3)
    # Samples: the mean of their irradiance is the power, and they lie where the light was.
    direction, _, irradiance = sun.sample(np.zeros((4000, 3)), rng.random((4000, 2)))
    np.testing.assert_allclose(irradiance.mean(axis=0), sun.power, rtol=0.05)
    centre = (lost * cube_map.solid_angles[:, None]).sum(axis=1) @ cube_map.directions
    assert direction.mean(axis=0) @ (centre / np.linalg.norm(centre)) > 0.998


def test_an_even_sky_has_no_sun():
    environment = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    assert split_sun(environment) == (environment, None)
