"""Decompositions of large matrices against numpy's, in every way that they are found."""

import numpy as np
import pytest

from prt_core.compress import PCA, ArrayRows
from prt_core.compress.clusters import affine as affine_module
from prt_core.compress.clusters.affine import fit_affine
from prt_core.compress.clusters.sketch import sketch_steps
from prt_core.compress.linalg import orthonormal_columns, principal_rows
from prt_core.runtime.progress import run


def steps(n, m, seed=0):
    """Rows like visibility: smooth edges that move, so that singular values fall slowly."""
    rng = np.random.default_rng(seed)
    place, edge = np.arange(m) / m, rng.random((n, 1))
    return (np.tanh(40 * (place - edge)) + 0.05 * rng.standard_normal((n, m))).astype(np.float32)


def residual(matrix, basis):
    rest = matrix.astype(np.float64) - (matrix @ basis.T) @ basis
    return (rest**2).sum()


# Few of many by iteration; of flat and of tall ones by their Gram matrix.
@pytest.mark.parametrize("shape, rank", [((600, 500), 12), ((260, 400), 60), ((400, 260), 60)])
def test_large_matrices_have_the_singular_vectors_of_numpy(shape, rank):
    matrix = steps(*shape)
    basis, energies = principal_rows(matrix, rank)
    values = np.linalg.svd(matrix.astype(np.float64), compute_uv=False)
    assert basis.shape == (rank, shape[1])
    np.testing.assert_allclose(basis @ basis.T, np.eye(rank), atol=2e-5)
    np.testing.assert_allclose(energies, values[:rank] ** 2, rtol=5e-3)
    # What is left is larger by 2e-4 at most.
    best = (values[rank:] ** 2).sum()
    assert residual(matrix, basis) < (1 + 3e-4) * best


def test_weak_directions_are_orthonormal_too():
    rng = np.random.default_rng(1)
    left = np.linalg.qr(rng.standard_normal((300, 300)))[0]
    right = np.linalg.qr(rng.standard_normal((400, 300)))[0].T
    matrix = ((left * 0.93 ** np.arange(300)) @ right).astype(np.float32)
    basis, energies = principal_rows(matrix, 90)
    assert len(basis) == 90 and energies[-1] < 1e-5 * energies[0]
    np.testing.assert_allclose(basis @ basis.T, np.eye(90), atol=2e-5)


@pytest.mark.parametrize("condition", [10, 3e3])
def test_a_basis_of_columns_is_orthonormal_and_spans_them(condition):
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.standard_normal((20, 20)))[0]
    columns = np.linalg.qr(rng.standard_normal((900, 20)))[0]
    sizes = np.geomspace(1, 1 / condition, 20)
    matrix = ((columns * sizes) @ turn).astype(np.float32)
    basis = orthonormal_columns(matrix)
    assert basis.shape == (900, 20) and basis.dtype == np.float32
    np.testing.assert_allclose(basis.T @ basis, np.eye(20), atol=3e-6)
    rest = matrix - basis @ (basis.T @ matrix)
    assert np.abs(rest).max() < 1e-5 * np.abs(matrix).max()


def test_rows_of_a_large_cluster_come_back_as_those_of_a_small_one(monkeypatch):
    matrix = steps(2600, 96)
    rows, every = ArrayRows(matrix), np.arange(2600)
    whole = fit_affine(rows, every, 9)
    best = np.linalg.svd(matrix - matrix.mean(axis=0, dtype=np.float64), compute_uv=False)
    monkeypatch.setattr(affine_module, "MOST_ROWS", 500)
    blocked = fit_affine(rows, every, 9)
    for model in (whole, blocked):
        result = model.mean + model.weights @ model.basis
        lost = ((matrix.astype(np.float64) - result) ** 2).sum()
        assert lost == pytest.approx((best[9:] ** 2).sum(), rel=2e-3)
        assert lost == pytest.approx(model.error, rel=1e-3)
        # Strongest first, and uncorrelated, so that the weakest can be left out.
        assert (np.diff(model.energies) <= 0).all()
        gram = model.weights.T.astype(np.float64) @ model.weights
        np.testing.assert_allclose(gram, np.diag(model.energies), atol=1e-3 * gram[0, 0])
    model = PCA(9).fit(rows)
    result = model.reconstruct(every[::37])[..., 0]
    lost = np.linalg.norm(result - matrix[::37]) / np.linalg.norm(matrix[::37])
    assert lost == pytest.approx(model.matrix_error_, rel=0.1)


def test_rows_that_differ_by_rounding_alone_need_no_component():
    rng = np.random.default_rng(3)
    row = rng.random(96) + 1
    matrix = (row * (1 + 5e-8 * rng.standard_normal((40, 96)))).astype(np.float32)
    assert 0 < np.ptp(matrix, axis=0).max() < 1e-6
    assert len(fit_affine(ArrayRows(matrix), np.arange(40), 5).basis) == 0
    matrix[3] *= 1.01
    assert len(fit_affine(ArrayRows(matrix), np.arange(40), 5).basis) >= 1


def test_a_sketch_keeps_lengths():
    matrix = steps(300, 64)
    sketch = run(sketch_steps(ArrayRows(matrix), 10))
    np.testing.assert_allclose(sketch.basis @ sketch.basis.T, np.eye(10), atol=1e-4)
    for row in (0, 17, 299):
        along = matrix[row].astype(np.float64) @ sketch.basis.T
        np.testing.assert_allclose(sketch.coordinates[row], along, atol=1e-3)
        rest = matrix[row].astype(np.float64) @ matrix[row] - along @ along
        assert sketch.rest[row] == pytest.approx(rest, rel=1e-3, abs=1e-3)
    values = np.linalg.svd(matrix, compute_uv=False)
    assert sketch.rest.sum() < 1.02 * (values[10:] ** 2).sum()
