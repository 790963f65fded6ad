import numpy as np
import pytest
from sklearn.linear_model import Lasso

from prt_core.reconstruct import gram, l1_batched, l1_certificate, l1_interior_point


def problems(n=7, k=11, m=23, seed=0, correlated=True):
    """Columns that look like neighbours' visibility: much alike, and a sparse combination."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((n, k, m))
    if correlated:
        columns = (columns + 1.5 * rng.standard_normal((n, 1, m)) > 0).astype(float)
    planted = np.zeros((n, k))
    planted[:, [1, 4, 8]] = [0.5, 0.3, 0.2]
    targets = np.einsum("nkm,nk->nm", columns, planted)
    return columns, targets + 0.02 * rng.standard_normal((n, m)), planted


def solved(columns, targets, share):
    grams, moments, squares = gram(columns, targets)
    strengths = share * np.abs(moments).max(axis=1)
    return l1_batched(grams, moments, squares, strengths), strengths


def objective(columns, target, strength, weights):
    residual = target - columns.T @ weights
    return residual @ residual / 2 + strength * np.abs(weights).sum()


def lasso(columns, target, strength):
    model = Lasso(strength / len(target), fit_intercept=False, tol=1e-12, max_iter=200_000)
    return model.fit(columns.T, target).coef_


@pytest.mark.parametrize("share", [0.3, 1e-2, 1e-4])
@pytest.mark.parametrize("correlated", [True, False])
def test_objectives_equal_those_of_scikit_learn(share, correlated):
    columns, targets, _ = problems(correlated=correlated)
    result, strengths = solved(columns, targets, share)
    for i in range(len(columns)):
        wanted = objective(columns[i], targets[i], strengths[i], lasso(
            columns[i], targets[i], strengths[i]))  # fmt: skip
        ours = objective(columns[i], targets[i], strengths[i], result.weights[i])
        assert abs(ours - wanted) <= 1e-6 * wanted, (i, ours, wanted)
        assert result.objective[i] == pytest.approx(ours, rel=1e-9)


@pytest.mark.parametrize("share", [0.3, 1e-2, 1e-4])
@pytest.mark.parametrize("solver", ["cholesky", "pcg"])
def test_the_interior_point_method_agrees(share, solver):
    columns, targets, _ = problems()
    result, strengths = solved(columns, targets, share)
    for i in range(3):
        one = l1_interior_point(columns[i], targets[i], strengths[i], 1e-9, solver=solver)
        assert 0 <= one.gap <= 1e-9 * (targets[i] @ targets[i]) / 2
        assert one.objective - one.gap <= result.objective[i] * (1 + 1e-12)
        assert one.objective <= result.objective[i] + 1e-9 * (targets[i] @ targets[i])


def test_the_gap_bounds_what_is_missing_for_any_weights():
    columns, targets, _ = problems()
    result, strengths = solved(columns, targets, 1e-2)
    assert (result.gap <= 1e-9 * result.objective).all()
    rng = np.random.default_rng(3)
    for size in (1e-3, 1.0):
        other = result.weights + size * rng.standard_normal(result.weights.shape)
        value, gap = l1_certificate(*gram(columns, targets), strengths, other)
        assert (value >= result.objective * (1 - 1e-12)).all()
        assert (value - gap <= result.objective * (1 + 1e-9)).all()
        assert (gap > 0).all()


def test_from_the_largest_lambda_on_all_weights_are_zero():
    columns, targets, _ = problems()
    result, _ = solved(columns, targets, 1.0)
    assert not result.weights.any()
    assert (result.gap <= 1e-12 * result.objective).all()
    below, _ = solved(columns, targets, 0.99)
    assert (np.count_nonzero(below.weights, axis=1) == 1).all()
    grams, moments, squares = gram(columns, targets)
    top = np.abs(moments).max(axis=1)
    for i in range(3):
        assert not np.abs(l1_interior_point(columns[i], targets[i], top[i]).weights).max() > 1e-4


def test_a_planted_sparse_solution_is_found():
    columns, targets, planted = problems(correlated=False, k=40, m=60)
    targets = np.einsum("nkm,nk->nm", columns, planted)
    result, _ = solved(columns, targets, 1e-6)
    np.testing.assert_allclose(result.weights, planted, atol=1e-5)
    np.testing.assert_array_equal(np.abs(result.weights) > 1e-4, planted > 0)


def test_more_unknowns_than_constraints():
    columns, targets, _ = problems(k=40, m=13)
    result, strengths = solved(columns, targets, 1e-3)
    assert (result.gap <= 1e-7 * np.einsum("nm,nm->n", targets, targets)).all()
    wanted = [
        objective(columns[i], targets[i], s, lasso(columns[i], targets[i], s))
        for i, s in enumerate(strengths)
    ]
    np.testing.assert_allclose(result.objective, wanted, rtol=1e-6)


def test_equal_columns_zero_rows_and_zero_columns():
    columns, targets, _ = problems()
    plain, strengths = solved(columns, targets, 1e-2)
    twice = np.concatenate([columns, columns[:, :5], np.zeros_like(columns[:, :2])], axis=1)
    twice = np.concatenate([twice, np.zeros_like(twice[:, :, :9])], axis=2)
    longer = np.concatenate([targets, np.zeros_like(targets[:, :9])], axis=1)
    result = l1_batched(*gram(twice, longer), strengths)
    np.testing.assert_allclose(result.objective, plain.objective, rtol=1e-8)
    assert np.isfinite(result.weights).all()
    assert not result.weights[:, -2:].any()


def test_one_neighbour_and_nothing_seen():
    columns, targets, _ = problems(k=9)
    targets[2] = 0
    grams, moments, squares = gram(columns[:, :1], targets)
    strengths = np.full(len(targets), 0.01)
    result = l1_batched(grams, moments, squares, strengths)
    size = grams[:, 0, 0]
    wanted = np.sign(moments[:, 0]) * np.maximum(np.abs(moments[:, 0]) - 0.01, 0) / size
    np.testing.assert_allclose(result.weights[:, 0], wanted, rtol=1e-9)
    assert result.weights[2] == 0
    assert result.gap[2] == 0


def test_a_start_and_other_problems_beside_do_not_matter():
    columns, targets, _ = problems(n=9)
    grams, moments, squares = gram(columns, targets)
    strengths = np.full(9, 0.05)
    result = l1_batched(grams, moments, squares, strengths)
    warm = l1_batched(grams, moments, squares, strengths, start=result.weights)
    assert warm.iterations.max() <= 2
    np.testing.assert_allclose(warm.weights, result.weights, atol=1e-9)
    rough = np.random.default_rng(0).standard_normal(result.weights.shape)
    other = l1_batched(grams, moments, squares, strengths, start=rough)
    np.testing.assert_allclose(other.objective, result.objective, rtol=1e-9)
    alone = l1_batched(grams[4:5], moments[4:5], squares[4:5], strengths[4:5])
    np.testing.assert_allclose(alone.weights[0], result.weights[4], atol=1e-9)


@pytest.mark.parametrize("scale", [1e-6, 1e5])
def test_the_scale_of_the_rows_does_not_matter(scale):
    columns, targets, _ = problems()
    result, _ = solved(columns, targets, 1e-2)
    scaled, _ = solved(columns * scale, targets * scale, 1e-2)
    np.testing.assert_allclose(scaled.weights, result.weights, atol=1e-7)
