"""Exemplar orthonormal bases: pairs that make many small matrices sparse.

    E = sum_i sum_a M_ia |H_i - U_a S_ia V_a^T|^2,   S_ia sparse,  U_a, V_a orthonormal      (1)

Gurumoorthy et al. 2010 train the pairs with memberships M that are annealed until they are
binary; Miandji et al. 2013 (equations 1 and 2) train them for HRDFs. `train_pairs_steps` does it
as published, or with memberships that are binary from the start and begun by k-means. Each update
is the minimum of E in what it updates: S has the largest coefficients of U^T H V, and U is the
orthonormal factor of Y = sum M H V S^T. The published (Y^T Y)^(-1/2) is not finite where Y has not
its full rank; the factor by SVD is the same where it has, and exists always.
"""

import numpy as np
from scipy.special import logsumexp

from prt_core.compress.clusters.kmeans import kmeans_steps
from prt_core.compress.dictionaries.sparsity import Sparsity
from prt_core.errors import expect_array, expect_kind, expect_one_of, expect_seed, expect_whole
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator

TRAININGS = ("hard", "annealed")
# Hard memberships: rounds at most, updates of each pair in a round, and the share of the energy
# below which a round counts as without change.
_ROUNDS, _UPDATES, _SETTLED = 32, 8, 5e-4
# Annealing: the first temperature in spreads of the errors, its factor, updates at most at one
# temperature, the change of the energy that ends them, and how far from binary the end is.
_FIRST, _COOLING, _SWEEPS, _SWEEP_SETTLED, _BINARY = 0.5, 1.6, 8, 2e-3, 1e-2
_TEMPERATURES = 40
# Matrices whose products fit a core's cache.
_BLOCK = 512


def train_pairs_steps(matrices, n_pairs, sparsity, training="hard", seed=0):
    """Train pairs of orthonormal bases; a generator of `Progress`.

    Parameters
    ----------
    matrices : (n, m1, m2) float32
        Those that are 0 take no part.
    n_pairs : int
        Fewer come back where fewer matrices are not 0; at least one.
    sparsity : Sparsity
        What is kept of the coefficients while training.
    training : {"hard", "annealed"}
    seed : int

    Returns
    -------
    left : (k, m1, m1) float32
    right : (k, m2, m2) float32
        Orthonormal columns; S = left^T H right.
    """
    matrices = expect_array("matrices", matrices, (None, None, None), np.float32)
    n_pairs = expect_whole("n_pairs", n_pairs, 1)
    expect_kind("sparsity", sparsity, Sparsity)
    expect_one_of("training", training, TRAININGS)
    expect_seed(seed)
    energies = np.einsum("nij,nij->n", matrices, matrices, dtype=np.float64)
    matrices = matrices[energies > 0]
    m1, m2 = matrices.shape[1:]
    if not len(matrices):
        return np.eye(m1, dtype=np.float32)[None], np.eye(m2, dtype=np.float32)[None]
    n_pairs = min(n_pairs, len(matrices))
    train = _hard_steps if training == "hard" else _annealed_steps
    pairs = yield from train(matrices, n_pairs, sparsity, seed)
    left, right = zip(*pairs, strict=True)
    return np.stack(left), np.stack(right)


def coefficients_of(matrices, pair):
    """(n, m1, m2) float32: S = U^T H V of (n, m1, m2) float32 matrices in one `pair` (U, V)."""
    left, right = pair
    return np.matmul(left.T, matrices @ right)


def cost_of(matrices, pair, sparsity):
    """(n,) float64: cost of (n, m1, m2) matrices in a `pair`, by the rule of a `sparsity`."""
    parts = []
    for first in range(0, len(matrices), _BLOCK):
        rows = coefficients_of(matrices[first : first + _BLOCK], pair)
        rows = rows.reshape(len(rows), -1)
        parts.append(sparsity.cost(rows, sparsity.kept(rows)))
    return np.concatenate(parts) if parts else np.zeros(0)


def _costs(matrices, pairs, sparsity):
    """(n, k) float64, in threads."""
    columns = in_parallel(lambda pair: cost_of(matrices, pair, sparsity), pairs)
    return np.stack(list(columns), axis=1)


def _hard_steps(matrices, n_pairs, sparsity, seed):
    """Each matrix belongs to one pair at a time, as in k-means (Lloyd 1982)."""
    flat = matrices.reshape(len(matrices), -1)
    labels = yield from kmeans_steps(flat, n_pairs, seed)
    pairs = [_principal_pair(matrices[labels == a]) for a in range(n_pairs)]
    before = np.inf
    for turn in range(_ROUNDS):
        members = [matrices[labels == a] for a in range(n_pairs)]
        done = in_parallel(lambda each: _updated(*each, sparsity), zip(members, pairs, strict=True))
        pairs = []
        for pair in done:
            pairs.append(pair)
            yield Progress("exemplar pairs", turn * n_pairs + len(pairs), _ROUNDS * n_pairs)
        costs = _costs(matrices, pairs, sparsity)
        labels = costs.argmin(axis=1)
        energy = costs.min(axis=1).sum()
        empty = np.flatnonzero(np.bincount(labels, minlength=n_pairs) == 0)
        # A pair that nobody uses begins again with the matrix that is worst off.
        worst = np.argsort(-costs.min(axis=1), kind="stable")[: len(empty)]
        for a, i in zip(empty, worst, strict=True):
            pairs[a] = _principal_pair(matrices[i : i + 1])
        if not len(empty) and energy >= (1 - _SETTLED) * before:
            break
        before = energy
    return pairs


def _updated(members, pair, sparsity):
    for _ in range(_UPDATES if len(members) else 0):
        pair = _update(members, pair, sparsity, None)
    return pair


def _update(matrices, pair, sparsity, shares):
    """One update of U, then of V, each with the coefficients that are best for it.

    `shares` (n,) float32 are the memberships; None: all belong.
    """
    left, right = pair
    sums = np.zeros(left.shape), np.zeros(right.shape)
    for block, share in _blocks(matrices, shares):
        half = block @ right
        kept = _sparse(np.matmul(left.T, half), sparsity, share)
        sums[0][:] += np.tensordot(half, kept, axes=([0, 2], [0, 2]))
    left = _orthonormal(sums[0])
    for block, share in _blocks(matrices, shares):
        half = np.matmul(left.T, block)
        kept = _sparse(half @ right, sparsity, share)
        sums[1][:] += np.tensordot(half, kept, axes=([0, 1], [0, 1]))
    return left, _orthonormal(sums[1])


def _blocks(matrices, shares):
    for first in range(0, len(matrices), _BLOCK):
        part = slice(first, first + _BLOCK)
        yield matrices[part], None if shares is None else shares[part]


def _sparse(coefficients, sparsity, share):
    """Coefficients that are kept, times the memberships."""
    rows = coefficients.reshape(len(coefficients), -1)
    rows *= sparsity.kept(rows)
    if share is not None:
        rows *= share[:, None]
    return coefficients


def _orthonormal(matrix):
    """The orthonormal matrix nearest to a square one: its polar factor, whatever its rank."""
    before, _, after = np.linalg.svd(matrix)
    return (before @ after).astype(np.float32)


def _principal_pair(matrices):
    """The bases of the strongest rows and columns of matrices: where training begins."""
    rows = np.tensordot(matrices, matrices, axes=([0, 2], [0, 2])).astype(np.float64)
    columns = np.tensordot(matrices, matrices, axes=([0, 1], [0, 1])).astype(np.float64)
    return tuple(np.linalg.eigh(gram)[1][:, ::-1].astype(np.float32) for gram in (rows, columns))


def _annealed_steps(matrices, n_pairs, sparsity, seed):
    """Memberships M_ia = exp(-beta E_ia) / sum_b exp(-beta E_ib), beta raised until binary."""
    rng = generator(seed, Stage.EXEMPLARS)
    n, m1, m2 = matrices.shape
    pairs = [
        tuple(_orthonormal(rng.standard_normal((m, m))) for m in (m1, m2)) for _ in range(n_pairs)
    ]
    shares = np.full((n, n_pairs), 1 / n_pairs, np.float32)
    beta = None
    for turn in range(_TEMPERATURES):
        before = np.inf
        for _ in range(_SWEEPS):
            columns = zip(pairs, shares.T, strict=True)
            pairs = list(
                in_parallel(lambda each: _update(matrices, each[0], sparsity, each[1]), columns)
            )
            yield Progress("exemplar pairs", turn, _TEMPERATURES)
            # E of equation 2 is the norm, not its square.
            errors = np.sqrt(_costs(matrices, pairs, sparsity))
            if beta is None:
                beta = _FIRST / max(errors.std(axis=1).mean(), 1e-30)
            # The temperature is one of the errors' spread; the sum is taken about its maximum.
            powers = -beta * errors
            shares = np.exp(powers - logsumexp(powers, axis=1, keepdims=True)).astype(np.float32)
            energy = (shares * errors**2).sum()
            if energy >= (1 - _SWEEP_SETTLED) * before:
                break
            before = energy
        if np.abs(shares - np.rint(shares)).max() < _BINARY:
            break
        beta *= _COOLING
    return pairs
