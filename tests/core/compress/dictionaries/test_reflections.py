"""Orthonormal bases as reflections."""

import numpy as np
import pytest

from prt_core.compress.dictionaries.reflections import (
    basis_of,
    n_reflection_numbers,
    reflections_of,
)


def orthonormal(size, columns, seed=0):
    return np.linalg.qr(np.random.default_rng(seed).standard_normal((size, size)))[0][:, :columns]


@pytest.mark.parametrize("shape", [(1, 1), (2, 1), (7, 3), (11, 11)])
def test_a_basis_comes_back_as_near_as_its_bits_allow(shape):
    basis, before = orthonormal(*shape), np.inf
    for bits in (6, 10, 16):
        numbers, signs = reflections_of(basis, bits)
        assert len(numbers) == n_reflection_numbers(*shape) and len(signs) == shape[1]
        assert np.abs(numbers.astype(int)).max(initial=0) < 1 << bits - 1
        again = basis_of(numbers, signs, shape[0], bits)
        assert again.dtype == np.float32 and again.shape == shape
        # Orthonormal whatever was rounded.
        assert np.allclose(again.T @ again, np.eye(shape[1]), atol=1e-6)
        error = np.abs(again - basis).max()
        assert error <= before and error < shape[0] * 2.0 ** (1 - bits)
        before = error


def test_the_first_columns_need_the_first_numbers_only():
    basis = orthonormal(9, 9)
    numbers, signs = reflections_of(basis, 12)
    whole = basis_of(numbers, signs, 9, 12)
    part = basis_of(numbers[: n_reflection_numbers(9, 4)], signs[:4], 9, 12)
    assert np.allclose(part, whole[:, :4], atol=1e-6)


def test_axes_and_their_opposites_are_exact():
    basis = np.diag([1, -1, 1, -1.0])[:, [0, 1, 3, 2]]
    assert (basis_of(*reflections_of(basis, 8), 4, 8) == basis).all()
