import numpy as np
import pytest
from scipy.special import sph_harm_y

from prt_core import PRTError
from prt_core.basis import (
    harmonic_products,
    harmonics,
    rotation_of_harmonics,
    rotations_of_harmonics,
    texel_harmonics,
)
from prt_core.sphere import FACES, CubeMap, rotation_matrix

RNG = np.random.default_rng(1)


def directions(n):
    d = RNG.standard_normal((n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def test_values_are_scipys():
    d = directions(50)
    theta, phi = np.arccos(d[:, 2]), np.arctan2(d[:, 1], d[:, 0])
    ours = harmonics(d, 10)
    for degree in range(10):
        for m in range(degree + 1):
            theirs = sph_harm_y(degree, m, theta, phi) * (-1) ** m * (1 if m == 0 else np.sqrt(2))
            centre = degree * (degree + 1)
            np.testing.assert_allclose(ours[:, centre + m], theirs.real, atol=1e-12)
            if m:
                np.testing.assert_allclose(ours[:, centre - m], theirs.imag, atol=1e-12)


def test_they_are_orthonormal_under_exact_quadrature():
    nodes, weights = np.polynomial.legendre.leggauss(16)
    phi = np.arange(32) * 2 * np.pi / 32
    z, p = np.meshgrid(nodes, phi, indexing="ij")
    r = np.sqrt(1 - z**2)
    values = harmonics(np.stack([r * np.cos(p), r * np.sin(p), z], axis=-1), 10)
    gram = np.einsum("ijk,ijl,i->kl", values, values, weights) * 2 * np.pi / 32
    assert np.abs(gram - np.eye(100)).max() < 1e-12


def test_texels_add_up_to_the_sphere():
    integrals = texel_harmonics(8, 4, FACES)
    total = np.zeros(16)
    total[0] = np.sqrt(4 * np.pi)
    np.testing.assert_allclose(integrals.sum(axis=0), total, atol=1e-7)
    areas = integrals[:, 0] * np.sqrt(4 * np.pi)
    np.testing.assert_allclose(areas, CubeMap(8).solid_angles, rtol=1e-6)


@pytest.mark.parametrize("order", [1, 3, 10])
def test_rotation_turns_the_function(order):
    matrix = rotation_matrix((20.0, -75.0, 130.0))
    turn = rotation_of_harmonics(matrix, order)
    assert np.abs(turn @ turn.T - np.eye(order**2)).max() < 1e-12
    coefficients = RNG.standard_normal(order**2)
    d = directions(20)
    np.testing.assert_allclose(
        harmonics(d, order) @ (turn @ coefficients),
        harmonics(d @ matrix, order) @ coefficients,
        atol=1e-12,
    )


def test_what_is_no_rotation_or_order_is_refused():
    with pytest.raises(PRTError, match="matrix"):
        rotation_of_harmonics(np.diag([1, 2, 1]), 3)
    with pytest.raises(PRTError, match="order"):
        harmonics(np.array([0, 0, 1.0]), 0)


def test_many_rotations_are_those_of_one_at_a_time():
    rng = np.random.default_rng(2)
    matrices = np.linalg.qr(rng.normal(size=(7, 3, 3)))[0]
    matrices *= np.linalg.det(matrices)[:, None, None]
    blocks = rotations_of_harmonics(matrices, 5)
    for index, matrix in enumerate(matrices):
        whole = rotation_of_harmonics(matrix, 5)
        for degree, block in enumerate(blocks):
            part = slice(degree**2, (degree + 1) ** 2)
            np.testing.assert_allclose(block[index], whole[part, part], atol=1e-12)


@pytest.mark.parametrize("order", [1, 3, 5])
def test_products_of_harmonics_are_sums_of_harmonics(order):
    rng = np.random.default_rng(order)
    directions = rng.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    values = harmonics(directions, order)
    result = harmonic_products(order)
    assert result.shape == (order**2, order**2, (2 * order - 1) ** 2)
    sums = harmonics(directions, 2 * order - 1) @ result.reshape(order**4, -1).T
    np.testing.assert_allclose(
        sums.reshape(50, order**2, -1), values[:, :, None] * values[:, None], atol=1e-11
    )
