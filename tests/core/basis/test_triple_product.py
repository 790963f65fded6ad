import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import haar_rows
from prt_core.basis.triple_product import (
    multiplication_matrix,
    square_means,
    triple_product,
    tripling_coefficients,
)


def sparse_row(rng, n, kept):
    row = np.zeros(n)
    row[rng.choice(n, kept, replace=False)] = rng.normal(size=kept)
    return row


@pytest.mark.parametrize("resolution", [2, 3, 6])
def test_the_three_rules_are_all_sums_over_texels(resolution):
    n = 6 * resolution**2
    wavelets = haar_rows(np.eye(n), resolution, inverse=True)
    # One face is like another, and faces do not meet.
    some = np.concatenate([np.arange(resolution**2), [n - 1]])
    wanted = np.einsum("it,jt,kt->ijk", *3 * [wavelets[some]])
    i, j, k = (x.ravel() for x in np.meshgrid(some, some, some, indexing="ij"))
    result = tripling_coefficients(i, j, k, resolution)
    np.testing.assert_allclose(result, wanted.ravel(), atol=1e-14)
    assert 0 < np.count_nonzero(result) < len(result) / 2


@pytest.mark.parametrize("resolution", [1, 5, 16, 32, 64])
def test_triple_products_are_those_of_texels(resolution):
    rng = np.random.default_rng(resolution)
    n = 6 * resolution**2
    kept = max(5, n // 50) if resolution > 5 else n
    rows = [sparse_row(rng, n, kept) for _ in range(3)]
    texels = [haar_rows(row, resolution, inverse=True) for row in rows]
    wanted = (texels[0] * texels[1] * texels[2]).sum()
    size = np.abs(texels[0] * texels[1] * texels[2]).sum()
    assert size > 0
    assert abs(triple_product(*rows, resolution) - wanted) < 1e-12 * size


def test_triple_products_of_whole_functions():
    rng = np.random.default_rng(3)
    texels = [rng.normal(size=6 * 16**2) for _ in range(2)]
    texels.append((rng.random(6 * 16**2) < 0.5).astype(float))
    rows = [haar_rows(t, 16) for t in texels]
    wanted = (texels[0] * texels[1] * texels[2]).sum()
    assert abs(triple_product(*rows, 16) - wanted) < 1e-12 * np.abs(texels[0] * texels[1]).sum()


@pytest.mark.parametrize("resolution", [7, 8, 12])
def test_multiplication_is_that_of_texels(resolution):
    rng = np.random.default_rng(1)
    n = 6 * resolution**2
    f, g = sparse_row(rng, n, 11), rng.normal(size=n)
    matrix = multiplication_matrix(f, resolution)
    product = haar_rows(f, resolution, inverse=True) * haar_rows(g, resolution, inverse=True)
    np.testing.assert_allclose(matrix @ g, haar_rows(product, resolution), atol=1e-13)
    assert abs(matrix - matrix.T).max() < 1e-15
    assert matrix.nnz <= n + 11 * 2 * 13


def test_means_of_squares():
    faces = np.random.default_rng(0).random((6, 4, 4))
    means = square_means(haar_rows(faces.reshape(-1), 4), 4).reshape(6, 4, 4)
    np.testing.assert_allclose(means[:, 0, 0], faces.mean(axis=(1, 2)))
    np.testing.assert_allclose(means[:, 1, 1], faces.mean(axis=(1, 2)))
    np.testing.assert_allclose(means[2, 1, 2], faces[2, 2:, :2].mean())
    np.testing.assert_allclose(means[2, 3, 3], faces[2, 2:, 2:].mean())


def test_what_does_not_fit_is_said():
    with pytest.raises(PRTError, match=r"rows: expected \(..., 24\), got \(23,\)"):
        triple_product(np.ones(24), np.ones(23), np.ones(24), 2)
    with pytest.raises(PRTError, match="expected a row of one function"):
        multiplication_matrix(np.ones((2, 24)), 2)
    with pytest.raises(PRTError, match="k: expected values from 0 to 23"):
        tripling_coefficients([0], [1], [24], 2)
