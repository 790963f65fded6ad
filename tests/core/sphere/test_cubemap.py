import numpy as np
import pytest

from prt_core import PRTError
from prt_core.sphere import CubeMap


@pytest.mark.parametrize("resolution", [1, 2, 3, 7, 32])
def test_solid_angles_and_vectors_are_exact(resolution):
    cube_map = CubeMap(resolution)
    assert abs(cube_map.solid_angles.sum() - 4 * np.pi) < 1e-12
    # The whole sphere has no direction; the upper half integrates to pi along z.
    np.testing.assert_allclose(cube_map.vectors.sum(axis=0), 0, atol=1e-12)
    if resolution % 2 == 0:
        upper = cube_map.directions[:, 2] > 0
        assert abs(cube_map.vectors[upper, 2].sum() - np.pi) < 1e-12
    # A texel's integral is shorter than its solid angle, by its spread.
    length = np.linalg.norm(cube_map.vectors, axis=1)
    assert (length <= cube_map.solid_angles + 1e-15).all()


def test_vectors_agree_with_quadrature():
    fine, coarse = CubeMap(128), CubeMap(4)
    group = coarse.texel_of(fine.directions)
    sums = [
        np.bincount(group, fine.directions[:, k] * fine.solid_angles, coarse.n_directions)
        for k in range(3)
    ]
    np.testing.assert_allclose(np.stack(sums, axis=1), coarse.vectors, rtol=0, atol=2e-5)


@pytest.mark.parametrize("resolution", [1, 2, 5, 11])
def test_texels_hold_their_own_direction(resolution):
    cube_map = CubeMap(resolution)
    result = cube_map.texel_of(cube_map.directions * 3.7)
    np.testing.assert_array_equal(result, np.arange(cube_map.n_directions))


@pytest.mark.parametrize("resolution", [1, 3, 8, 32])
def test_traced_directions_lie_in_their_texels_and_are_always_the_same(resolution):
    cube_map = CubeMap(resolution)
    np.testing.assert_array_equal(
        cube_map.texel_of(cube_map.samples), np.arange(cube_map.n_directions)
    )
    np.testing.assert_array_equal(cube_map.samples, CubeMap(resolution).samples)


def test_traced_directions_are_spread_along_rows_and_columns():
    # Heights of a row of eight texels on +x fall into eight different eighths, and so the widths.
    face = CubeMap(32).samples[: 32 * 32]
    u, v = ((face[:, k] / face[:, 0] + 1) * 16 for k in (1, 2))
    heights = np.sort((v.reshape(32, 4, 8) % 1 * 8).astype(int), axis=2)
    widths = np.sort((u.reshape(4, 8, 32) % 1 * 8).astype(int), axis=1)
    assert (heights == np.arange(8)).all()
    assert (widths == np.arange(8)[:, None]).all()


def test_random_directions_fall_into_the_nearest_texels():
    cube_map, rng = CubeMap(9), np.random.default_rng(0)
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cosine = (directions * cube_map.directions[cube_map.texel_of(directions)]).sum(axis=1)
    # No further than a texel's corner from its centre.
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < np.degrees(np.sqrt(2) / 9) * 1.01


def test_bad_input_is_named():
    with pytest.raises(PRTError, match="resolution: expected a whole number"):
        CubeMap(0)
    with pytest.raises(PRTError, match="length zero"):
        CubeMap(2).texel_of(np.zeros((1, 3)))
