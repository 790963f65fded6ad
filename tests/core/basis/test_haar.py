import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import (
    haar_areas,
    haar_forward,
    haar_inverse,
    haar_levels,
    haar_rows,
    haar_texels,
)

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("size", [1, 2, 3, 8, 12, 32])
@pytest.mark.parametrize("dtype, bound", [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_reconstruction_is_perfect(size, dtype, bound):
    faces = RNG.standard_normal((2, 3, size, size)).astype(dtype)
    for levels in range(haar_levels(size) + 1):
        coefficients = haar_forward(faces, levels)
        assert coefficients.dtype == dtype
        assert np.abs(haar_inverse(coefficients, levels) - faces).max() < bound
        assert abs((coefficients**2).sum() / (faces**2).sum() - 1) < bound


@pytest.mark.parametrize("resolution", [4, 6, 8])
def test_basis_is_orthonormal(resolution):
    basis = haar_rows(np.eye(6 * resolution**2), resolution)
    assert np.abs(basis @ basis.T - np.eye(len(basis))).max() < 1e-12


@pytest.mark.parametrize("resolution", [1, 2, 3, 6, 8])
def test_rows_of_one_texel_have_few_coefficients(resolution):
    n = 6 * resolution**2
    wanted = haar_rows(np.eye(n, dtype=np.float32), resolution)
    texels = RNG.permutation(n)
    places, values = haar_texels(texels, resolution)
    assert places.shape == values.shape == (n, 3 * haar_levels(resolution) + 1)
    result = np.zeros_like(wanted)
    np.put_along_axis(result, places, values, axis=1)
    np.testing.assert_array_equal(result, wanted[texels])
    with pytest.raises(PRTError, match="texels: expected values from 0"):
        haar_texels([n], resolution)


def test_areas_are_those_of_the_wavelets():
    basis = haar_rows(np.eye(6 * 16), 4, inverse=True)
    level, area = haar_areas(4)
    np.testing.assert_array_equal((np.abs(basis) > 1e-9).sum(axis=1), area)
    assert level.min() == 0 and level.max() == 1
    assert (level == 0).sum() == 6 * 4


@pytest.mark.parametrize("value", [0.0, 1.0, 1e5])
def test_a_constant_face_is_one_coefficient(value):
    coefficients = haar_forward(np.full((1, 8, 8), value))
    assert coefficients[0, 0, 0] == pytest.approx(8 * value, rel=1e-14)
    coefficients[0, 0, 0] = 0
    assert np.abs(coefficients).max() <= 1e-12 * value


def test_a_single_texel_needs_few_coefficients():
    faces = np.zeros((32, 32))
    faces[5, 17] = 1
    assert (haar_forward(faces) != 0).sum() == 1 + 3 * 5


def test_faces_must_be_square():
    with pytest.raises(PRTError, match="faces"):
        haar_forward(np.zeros((3, 4)))
    with pytest.raises(PRTError, match="levels"):
        haar_forward(np.zeros((4, 4)), 3)
