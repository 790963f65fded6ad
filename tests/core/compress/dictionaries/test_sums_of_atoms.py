"""Orthogonal matching pursuit and K-SVD."""

import numpy as np
import pytest

from prt_core import run
from prt_core.compress.dictionaries.ksvd import ksvd_steps
from prt_core.compress.dictionaries.omp import orthogonal_matching_pursuit
from prt_core.compress.dictionaries.sparsity import Sparsity
from prt_core.errors import PRTError


def unit(rows):
    return (rows / np.linalg.norm(rows, axis=1, keepdims=True)).astype(np.float32)


def planted(n=300, m=23, n_atoms=11, n_coefficients=3, seed=2):
    rng = np.random.default_rng(seed)
    atoms = unit(rng.standard_normal((n_atoms, m)))
    weights = np.zeros((n, n_atoms), np.float32)
    for row in weights:
        chosen = rng.choice(n_atoms, n_coefficients, replace=False)
        row[chosen] = rng.choice([-1, 1], n_coefficients) * (1 + rng.random(n_coefficients))
    return weights @ atoms, atoms, weights


def by_the_book(signal, atoms, count):
    """Choose, solve by least squares, again."""
    chosen, rest = [], signal.astype(np.float64)
    for _ in range(count):
        chosen.append(int(np.abs(atoms @ rest).argmax()))
        solved = np.linalg.lstsq(atoms[chosen].T.astype(np.float64), signal, rcond=None)[0]
        rest = signal - atoms[chosen].T @ solved
    result = np.zeros(len(atoms))
    result[chosen] = solved
    return result


def test_pursuit_is_that_of_the_book():
    rng = np.random.default_rng(0)
    atoms = unit(rng.standard_normal((13, 8)))
    signals = rng.standard_normal((40, 8)).astype(np.float32)
    for count in (1, 3, 5):
        result = orthogonal_matching_pursuit(signals, atoms, Sparsity(count))
        wanted = [by_the_book(signal, atoms, count) for signal in signals]
        assert np.allclose(result, wanted, atol=2e-4), count


def test_pursuit_ends_where_an_atom_is_not_worth_it_or_the_rest_is_small():
    signals, atoms, _ = planted()
    pursued = orthogonal_matching_pursuit(signals, atoms, Sparsity(threshold=0.5))
    counts = (pursued != 0).sum(axis=1)
    rest = signals - pursued @ atoms
    # What is left is no longer than what the next atom would have to save, over all atoms.
    assert np.abs(rest @ atoms.T).max() <= 0.5 + 1e-4
    assert 1 < counts.mean() < 6
    pursued = orthogonal_matching_pursuit(signals, atoms, Sparsity(error=0.3))
    assert np.linalg.norm(signals - pursued @ atoms, axis=1).max() <= 0.3 + 1e-4
    fewer = orthogonal_matching_pursuit(signals, atoms, Sparsity(error=0.9))
    assert (fewer != 0).sum() < (pursued != 0).sum()


def test_pursuit_bears_zeros_copies_and_more_coefficients_than_atoms():
    atoms = unit(np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0.0]]))
    signals = np.array([[0, 0, 0, 0], [2, 3, 0, 0], [1e6, 0, 0, 1]], np.float32)
    result = orthogonal_matching_pursuit(signals, atoms, Sparsity(9))
    assert np.allclose(result @ atoms, signals * [1, 1, 1, 0])
    assert not result[0].any() and (result != 0).sum(axis=1).max() <= 2
    assert orthogonal_matching_pursuit(signals[:0], atoms, Sparsity(2)).shape == (0, 3)
    with pytest.raises(PRTError, match="signals: expected an array of shape"):
        orthogonal_matching_pursuit(signals[:, :3], atoms, Sparsity(2))


def test_training_finds_planted_atoms():
    signals, atoms, _ = planted(n_coefficients=2)
    trained = run(ksvd_steps(signals, 11, 2, seed=3))
    assert trained.shape == (11, 23)
    assert np.allclose(np.linalg.norm(trained, axis=1), 1, atol=1e-5)
    # Up to their order and sign; one or two end as a mixture, as in the papers.
    best = np.abs(trained @ atoms.T).max(axis=0)
    assert (best > 0.99).sum() >= 9, best


def test_training_bears_zeros_and_few_signals():
    zeros = np.zeros((4, 6), np.float32)
    assert run(ksvd_steps(zeros, 5, 2)).shape == (1, 6)
    few = run(ksvd_steps(np.concatenate([zeros, np.eye(3, 6)]), 5, 2))
    assert few.shape == (3, 6) and np.isfinite(few).all()
    bad = zeros.copy()
    bad[1, 2] = np.inf
    with pytest.raises(PRTError, match="signals: 1 values are NaN or infinite"):
        run(ksvd_steps(bad, 5, 2))
