import numpy as np
import pytest

from prt_core.basis import haar_rows
from prt_core.basis.cube_symmetry import cube_symmetries, turned_wavelets
from prt_core.sphere import CubeMap


def test_they_are_all_different_and_orthogonal():
    matrices = cube_symmetries()
    assert len(np.unique(matrices.reshape(48, 9), axis=0)) == 48
    np.testing.assert_array_equal(
        matrices @ matrices.swapaxes(1, 2), np.tile(np.eye(3), (48, 1, 1))
    )
    np.testing.assert_array_equal(matrices[0], np.eye(3))


@pytest.mark.parametrize("resolution", [3, 8, 32])
def test_turned_coefficients_are_those_of_the_turned_function(resolution):
    cube_map = CubeMap(resolution)
    places, signs = turned_wavelets(cube_map)
    axis = np.array([0.48, 0.6, 0.64])
    lobe = np.exp(3 * cube_map.directions @ axis)
    row = haar_rows(lobe, resolution)
    for matrix, place, sign in zip(cube_symmetries(), places, signs, strict=True):
        turned = np.zeros_like(row)
        turned[place] = sign * row
        wanted = haar_rows(np.exp(3 * cube_map.directions @ (matrix @ axis)), resolution)
        np.testing.assert_allclose(turned, wanted, atol=1e-10)
