import numpy as np
import pytest

from prt_core.reconstruct import gram, least_squares


def problems(n=5, k=7, m=31, seed=0):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((n, k, m)), rng.standard_normal((n, m))


@pytest.mark.parametrize("k, m", [(1, 31), (7, 31), (13, 5)])
def test_it_is_the_solution_of_least_norm(k, m):
    columns, targets = problems(k=k, m=m)
    weights, slope = least_squares(*gram(columns, targets)[:2])
    assert (slope < 1e-9).all()
    for i in range(len(columns)):
        wanted = np.linalg.lstsq(columns[i].T, targets[i], rcond=None)[0]
        np.testing.assert_allclose(weights[i], wanted, atol=1e-8)


def test_equal_columns_share_and_zero_columns_get_nothing():
    columns, targets = problems()
    alone, _ = least_squares(*gram(columns, targets)[:2])
    more = np.concatenate([columns, columns[:, :1], 0 * columns[:, :1]], axis=1)
    weights, slope = least_squares(*gram(more, targets)[:2])
    np.testing.assert_allclose(weights[:, 0], alone[:, 0] / 2, rtol=1e-8)
    np.testing.assert_allclose(weights[:, 7], alone[:, 0] / 2, rtol=1e-8)
    assert (np.abs(weights[:, 8]) < 1e-12).all()
    assert (slope < 1e-9).all()


def test_nothing_seen_gives_zero():
    columns, targets = problems()
    weights, slope = least_squares(*gram(columns, 0 * targets)[:2])
    assert not weights.any()
    assert not slope.any()
    weights, slope = least_squares(*gram(0 * columns, targets)[:2])
    assert not weights.any()
    assert not slope.any()


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_columns_that_are_nearly_alike_are_told_apart_at_any_scale(scale):
    # Singular values of 1e-4: far above the cut at 1e-6 of the largest.
    rng = np.random.default_rng(4)
    base = rng.standard_normal((3, 1, 23))
    columns = scale * (base + 1e-4 * rng.standard_normal((3, 4, 23)))
    planted = np.array([0.5, -2.0, 1.0, 3.0])
    targets = np.einsum("nkm,k->nm", columns, planted)
    weights, slope = least_squares(*gram(columns, targets)[:2])
    np.testing.assert_allclose(weights, np.tile(planted, (3, 1)), atol=1e-4)
    assert (slope < 1e-9).all()
