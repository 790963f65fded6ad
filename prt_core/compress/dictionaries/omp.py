"""Orthogonal matching pursuit for many signals at once (Batch-OMP; Rubinstein et al. 2008).

With the atoms' products with each other, no residual is ever made: only its products with the
atoms are kept. Orthogonalising the chosen atoms is a Cholesky factorisation of their products,
pivoted by what is chosen, a column of which is made in each step for all signals together.
"""

import numpy as np

from prt_core.compress.dictionaries.sparsity import Sparsity
from prt_core.errors import expect_array, expect_kind

# Signals of a block: their factors fit a core's cache.
_BLOCK = 256
# What is left of an atom's square beside the chosen ones, below which it is one of their sums.
_DEPENDENT = 1e-5


def orthogonal_matching_pursuit(signals, atoms, sparsity):
    """Sparse coefficients of signals.

    Parameters
    ----------
    signals : (n, m) float32
    atoms : (k, m) float32
        Of length 1.
    sparsity : Sparsity
        `threshold` and `error` as there: no more atoms once the next one saves no more than
        threshold^2 of squared error, or once the rest is within `error`.

    Returns
    -------
    (n, k) float32
        Zero where an atom is not chosen.
    """
    atoms = expect_array("atoms", atoms, (None, None), np.float32)
    signals = expect_array("signals", signals, (None, atoms.shape[1]), np.float32)
    expect_kind("sparsity", sparsity, Sparsity)
    products = atoms @ atoms.T
    parts = [
        _pursue(signals[first : first + _BLOCK], atoms, products, sparsity)
        for first in range(0, len(signals), _BLOCK)
    ]
    return np.concatenate(parts) if parts else np.zeros((0, len(atoms)), np.float32)


def _pursue(signals, atoms, products, sparsity):
    n, k = len(signals), len(atoms)
    most = min(k, atoms.shape[1], k if sparsity.n_coefficients is None else sparsity.n_coefficients)
    correlations = signals @ atoms.T
    lengths = np.ones((n, k), np.float32)
    rest = np.einsum("nm,nm->n", signals, signals, dtype=np.float64)
    # Rows of the factor, over all atoms; the chosen atoms; what each adds along its own direction.
    factor = np.zeros((n, most, k), np.float32)
    chosen, along = np.zeros((n, most), np.int64), np.zeros((n, most), np.float32)
    counts, going = np.zeros(n, np.int64), np.arange(n)
    for t in range(most):
        if sparsity.error is not None:
            going = going[rest[going] > sparsity.error**2]
        usable = np.where(lengths[going] > _DEPENDENT, np.abs(correlations[going]), 0)
        best = usable.argmax(axis=1)
        here = np.arange(len(going))
        gains = usable[here, best] / np.sqrt(lengths[going, best].clip(_DEPENDENT))
        good = gains > (sparsity.threshold or 0)
        going, best = going[good], best[good]
        if not len(going):
            break
        root = np.sqrt(lengths[going, best])
        known = factor[going, :t]
        row = products[best] - np.einsum("nt,ntk->nk", known[np.arange(len(going)), :, best], known)
        row /= root[:, None]
        gain = correlations[going, best] / root
        factor[going, t], chosen[going, t], along[going, t] = row, best, gain
        correlations[going] -= gain[:, None] * row
        lengths[going] -= row**2
        lengths[going, best] = 0
        rest[going] -= gain.astype(np.float64) ** 2
        counts[going] = t + 1
    return _solved(factor, chosen, along, counts, k)


def _solved(factor, chosen, along, counts, k):
    """Coefficients of the chosen atoms, from those of their orthogonal directions."""
    n, most = chosen.shape
    result, rows = np.zeros((n, k), np.float32), np.arange(n)
    values = along.copy()
    for t in reversed(range(most)):
        used = counts > t
        own = factor[rows, t, chosen[:, t]]
        values[:, t] = np.where(used, values[:, t] / np.where(used, own, 1), 0)
        # What this atom has along the directions of those before it.
        before = factor[rows[:, None], np.arange(t), chosen[:, t, None]]
        values[:, :t] -= values[:, t, None] * before
        result[rows[used], chosen[used, t]] = values[used, t]
    return result
