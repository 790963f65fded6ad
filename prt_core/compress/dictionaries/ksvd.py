"""K-SVD: atoms of which each signal is a sum of few (Aharon et al. 2006; Bryt and Elad 2008)."""

import numpy as np

from prt_core.compress.dictionaries.omp import orthogonal_matching_pursuit
from prt_core.compress.dictionaries.sparsity import Sparsity
from prt_core.errors import expect_array, expect_seed, expect_whole
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator

_BLOCK = 1024


def ksvd_steps(signals, n_atoms, n_coefficients, n_rounds=20, seed=0):
    """Train atoms; a generator of `Progress`.

    Each round pursues all signals, then turns each atom, with the coefficients that use it, to
    where the others leave most (one step of the power method in place of an SVD; Rubinstein et
    al. 2008). An atom that nobody uses begins again as the signal that is worst off.

    Parameters
    ----------
    signals : (n, m) float32
        Those that are 0 take no part.
    n_atoms : int
        As many come back, or as many as there are signals; at least one.
    n_coefficients : int
        Of each signal while training.
    n_rounds : int
    seed : int

    Returns
    -------
    (k, m) float32
        Of length 1.
    """
    signals = expect_array("signals", signals, (None, None), np.float32)
    n_atoms = expect_whole("n_atoms", n_atoms, 1)
    n_rounds, seed = expect_whole("n_rounds", n_rounds, 1), expect_seed(seed)
    sparsity = Sparsity(expect_whole("n_coefficients", n_coefficients, 1))
    lengths = np.linalg.norm(signals, axis=1)
    signals, lengths = signals[lengths > 0], lengths[lengths > 0]
    if not len(signals):
        return np.eye(1, signals.shape[1], dtype=np.float32)
    rng = generator(seed, Stage.ATOMS)
    first = rng.choice(len(signals), min(n_atoms, len(signals)), replace=False)
    atoms = signals[first] / lengths[first, None]
    for turn in range(n_rounds):
        pursued, parts = range(0, len(signals), _BLOCK), []

        def pursue(start, atoms=atoms):
            return orthogonal_matching_pursuit(signals[start : start + _BLOCK], atoms, sparsity)

        for part in in_parallel(pursue, pursued):
            parts.append(part)
            yield Progress("atoms", turn, n_rounds)
        atoms = _updated(signals, atoms, np.concatenate(parts))
    return atoms


def _updated(signals, atoms, coefficients):
    atoms = atoms.copy()
    rest = signals - coefficients @ atoms
    for k in range(len(atoms)):
        users = np.flatnonzero(coefficients[:, k])
        if not len(users):
            worst = int(np.einsum("nm,nm->n", rest, rest).argmax())
            length = np.linalg.norm(rest[worst])
            if length > 0:
                atoms[k] = rest[worst] / length
                rest[worst] = 0
            continue
        values = coefficients[users, k]
        without = rest[users] + values[:, None] * atoms[k]
        atom = values @ without
        length = np.linalg.norm(atom)
        if length > 0:
            atoms[k] = atom / length
            values = without @ atoms[k]
            coefficients[users, k] = values
            rest[users] = without - values[:, None] * atoms[k]
    return atoms
