"""Pairs of orthonormal bases: what training finds, and what it bears."""

import numpy as np
import pytest

from prt_core import run
from prt_core.compress.dictionaries.exemplar import coefficients_of, cost_of, train_pairs_steps
from prt_core.compress.dictionaries.sparsity import Sparsity
from prt_core.errors import PRTError


def orthonormal(rng, size):
    return np.linalg.qr(rng.standard_normal((size, size)))[0]


def planted(n=120, m1=7, m2=5, n_pairs=2, n_coefficients=3, seed=4):
    """Matrices that are exactly sparse in one of a few pairs."""
    rng = np.random.default_rng(seed)
    pairs = [(orthonormal(rng, m1), orthonormal(rng, m2)) for _ in range(n_pairs)]
    matrices = np.empty((n, m1, m2), np.float32)
    for i in range(n):
        table = np.zeros(m1 * m2)
        # Few places serve all, as in real fields, or no basis could be told from another.
        chosen = rng.choice(n_coefficients + 2, n_coefficients, replace=False) * 4
        table[chosen] = rng.standard_normal(n_coefficients) + 2
        left, right = pairs[i % n_pairs]
        matrices[i] = left @ table.reshape(m1, m2) @ right.T
    return matrices


def least_costs(matrices, pairs, sparsity):
    return np.min([cost_of(matrices, pair, sparsity) for pair in zip(*pairs, strict=True)], axis=0)


@pytest.mark.parametrize("training", ["hard", "annealed"])
def test_training_finds_bases_that_make_matrices_sparse(training):
    matrices, sparsity = planted(), Sparsity(3)
    left, right = run(train_pairs_steps(matrices, 4, sparsity, training, seed=1))
    assert left.shape == (4, 7, 7) and right.shape == (4, 5, 5)
    for bases, size in ((left, 7), (right, 5)):
        assert np.allclose(bases.transpose(0, 2, 1) @ bases, np.eye(size), atol=1e-5)
    energy = np.square(matrices, dtype=np.float64).sum()
    identity = np.eye(7, dtype=np.float32)[None], np.eye(5, dtype=np.float32)[None]
    plain = least_costs(matrices, identity, sparsity).sum()
    trained = least_costs(matrices, (left, right), sparsity).sum()
    # One pair for all, the best of second order (HOSVD), has to be beaten by far as well.
    one = run(train_pairs_steps(matrices, 1, sparsity, "hard"))
    assert trained < 1e-9 * energy < 0.1 * plain
    assert trained < 0.5 * least_costs(matrices, one, sparsity).sum()


def test_training_is_the_same_again_and_another_with_another_seed():
    matrices, sparsity = planted(), Sparsity(3)
    first, again = (run(train_pairs_steps(matrices, 3, sparsity, seed=5)) for _ in range(2))
    assert (first[0] == again[0]).all() and (first[1] == again[1]).all()
    other = run(train_pairs_steps(matrices, 3, sparsity, "annealed", seed=6))
    same = run(train_pairs_steps(matrices, 3, sparsity, "annealed", seed=7))
    assert not np.allclose(other[0], same[0])


def test_a_matrix_by_itself_needs_one_number_a_rank():
    matrix = planted(1)
    left, right = run(train_pairs_steps(matrix, 1, Sparsity(5)))
    values = np.linalg.svd(matrix[0])[1]
    table = coefficients_of(matrix, (left[0], right[0]))[0]
    assert np.allclose(np.sort(np.abs(table), axis=None)[::-1][:5], values, atol=1e-4)


@pytest.mark.parametrize("training", ["hard", "annealed"])
def test_what_breaks_the_printed_formulas(training):
    rng = np.random.default_rng(0)
    zero, constant = np.zeros((3, 6, 4)), np.ones((4, 6, 4))
    for matrices in (
        zero,
        constant,
        np.concatenate([zero, constant, rng.random((1, 6, 4))]),
        rng.random((2, 6, 4)) * 1e-20,
        rng.random((9, 1, 1)),
        np.concatenate([rng.random((30, 6, 4)), constant[:1] + 1e6 * np.eye(6, 4)]),
    ):
        left, right = run(train_pairs_steps(matrices, 5, Sparsity(3), training))
        m1, m2 = matrices.shape[1:]
        assert 1 <= len(left) == len(right) <= 5
        assert np.allclose(left.transpose(0, 2, 1) @ left, np.eye(m1), atol=1e-5)
        assert np.allclose(right.transpose(0, 2, 1) @ right, np.eye(m2), atol=1e-5)


def test_no_pair_stays_empty():
    rng = np.random.default_rng(1)
    # Many copies of few: k-means leaves clusters without members.
    matrices = np.repeat(rng.random((3, 5, 4)).astype(np.float32), 20, axis=0)
    matrices = np.concatenate([matrices, rng.random((6, 5, 4)).astype(np.float32)])
    left, right = run(train_pairs_steps(matrices, 8, Sparsity(2)))
    costs = np.stack([cost_of(matrices, p, Sparsity(2)) for p in zip(left, right, strict=True)])
    assert len(np.unique(costs.argmin(axis=0))) == len(left)


def test_wrong_input_is_refused_in_one_line():
    good = planted(5)
    bad = good.copy()
    bad[2, 1, 1] = np.nan
    for arguments, message in (
        ((bad, 2, Sparsity(3)), "matrices: 1 values are NaN or infinite"),
        ((good[0], 2, Sparsity(3)), "matrices: expected an array of shape"),
        ((good, 0, Sparsity(3)), "n_pairs: expected a whole number"),
        ((good, 2, 3), "sparsity: expected a Sparsity"),
        ((good, 2, Sparsity(3), "soft"), "training: expected one of hard, annealed"),
    ):
        with pytest.raises(PRTError, match=message):
            run(train_pairs_steps(*arguments))


def test_what_is_kept_is_the_largest_or_what_is_worth_it():
    rows = np.array([[3, -5, 1, 0.5], [0, 0, 0, 0], [2, 2, -2, 2]], np.float32)
    assert Sparsity(2).kept(rows).tolist() == [
        [True, True, False, False],
        [False] * 4,
        [True, True, False, False],
    ]
    assert (Sparsity(9).kept(rows) == (rows != 0)).all()
    assert not Sparsity(0).kept(rows).any()
    assert (Sparsity(threshold=1).kept(rows) == (np.abs(rows) > 1)).all()
    assert Sparsity(1, threshold=1).kept(rows).sum(axis=1).tolist() == [1, 0, 1]
    # Of row 0 the two smallest have length 1.118, the three smallest 3.2; of row 2 two 2.83.
    kept = Sparsity(error=1.2).kept(rows)
    assert kept.sum(axis=1).tolist() == [2, 0, 4]
    assert Sparsity(error=3).kept(rows).sum(axis=1).tolist() == [2, 0, 4]
    assert Sparsity(error=10).kept(rows).sum() == 0
    kept = Sparsity(threshold=1).kept(rows)
    assert np.allclose(Sparsity(threshold=1).cost(rows, kept), [1.25 + 2, 0, 4])
    for wrong, message in (
        ({}, "give one of"),
        ({"threshold": 1.0, "error": 1.0}, "give one of them"),
        ({"threshold": 0}, "threshold: expected a number above 0"),
        ({"n_coefficients": 1.5}, "n_coefficients: expected a whole number"),
    ):
        with pytest.raises(PRTError, match=message):
            Sparsity(**wrong)
