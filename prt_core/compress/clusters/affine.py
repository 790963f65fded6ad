"""The affine model of some rows: mean and principal directions, by truncated SVD in blocks."""

from dataclasses import dataclass

import numpy as np

from prt_core.compress.linalg import orthonormal_columns, principal_rows
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.seeds import Stage, generator

# Rows that are held at once; more are read in blocks, several times.
MOST_ROWS = 4096
_BLOCK, _SAMPLE, _EXTRA, _PASSES = 512, 1024, 16, 2


@dataclass
class Affine:
    """Rows as `mean + weights @ basis`.

    Attributes
    ----------
    mean : (n_features,) float32
    basis : (rank, n_features) float32
        Orthonormal rows, strongest first.
    weights : (n, rank) float32
    energies : (rank,) float64
        Squares of the singular values: what each component takes off the squared error.
    energy : float
        Sum of squares of the centred rows.
    """

    mean: np.ndarray
    basis: np.ndarray
    weights: np.ndarray
    energies: np.ndarray
    energy: float

    @property
    def error(self):
        """Squared error that is left."""
        return max(self.energy - float(self.energies.sum()), 0.0)

    def cut(self, rank):
        """The first `rank` components."""
        return Affine(
            self.mean,
            self.basis[:rank],
            np.ascontiguousarray(self.weights[:, :rank]),
            self.energies[:rank],
            self.energy,
        )


def fit_affine(rows, points, rank, seed=0):
    """The best affine model of some rows, of at most `rank` components.

    Parameters
    ----------
    rows : Rows
    points : (n,) int
        n >= 1. Up to `MOST_ROWS` are read once and solved exactly; of more, the subspace is
        found by randomised subspace iteration in blocks (Halko et al. 2011).
    rank, seed : int

    Returns
    -------
    Affine
        Fewer components where the rows have no more: equal rows need none.
    """
    if len(points) > MOST_ROWS:
        return _fit_blocks(rows, points, rank, seed)
    features = rows.features(points)
    mean = features.mean(axis=0, dtype=np.float64).astype(np.float32)
    features -= mean
    energy = float(np.einsum("nf,nf->n", features, features).sum(dtype=np.float64))
    energy = energy if len(points) > 1 else 0.0
    basis, _ = principal_rows(features, min(rank, len(points) - 1))
    # Equal rows differ from their mean by rounding: that is no component.
    if energy <= 1e-12 * len(points) * float(mean.astype(np.float64) @ mean):
        basis = basis[:0]
    weights = features @ basis.T
    return Affine(mean, basis, weights, (weights.astype(np.float64) ** 2).sum(axis=0), energy)


def _fit_blocks(rows, points, rank, seed):
    rng = generator(seed, Stage.SUBSPACE)
    blocks = [points[f : f + _BLOCK] for f in range(0, len(points), _BLOCK)]

    def sums(block):
        features = rows.features(block).astype(np.float64)
        return features.sum(axis=0), (features**2).sum()

    total, square = 0.0, 0.0
    for part, squares in in_parallel(sums, blocks):
        total, square = total + part, square + squares
    mean = total / len(points)
    energy = max(float(square - len(points) * (mean @ mean)), 0.0)
    mean = mean.astype(np.float32)
    sample = np.sort(rng.choice(points, _SAMPLE, replace=False))
    basis, _ = principal_rows(rows.features(sample) - mean, rank + _EXTRA)
    if not len(basis):
        return Affine(mean, basis, np.zeros((len(points), 0), np.float32), np.zeros(0), energy)

    def power(block):
        features = rows.features(block) - mean
        return features.T @ (features @ basis.T)

    for _ in range(_PASSES):
        product = np.zeros((basis.shape[1], len(basis)))
        for part in in_parallel(power, blocks):
            product += part
        basis = orthonormal_columns(product.astype(np.float32)).T.copy()

    def project(block):
        return (rows.features(block) - mean) @ basis.T

    weights = np.concatenate(list(in_parallel(project, blocks)))
    # Turn the subspace so that its components are uncorrelated and the weakest can be left out.
    turn, _ = principal_rows(weights, rank)
    weights = weights @ turn.T
    energies = (weights.astype(np.float64) ** 2).sum(axis=0)
    return Affine(mean, turn @ basis, weights, energies, energy)
