"""Clustered exemplar orthogonal bases (CEOB; Miandji et al. 2013, section 4)."""

import numpy as np

from prt_core.compress.dictionaries.exemplar import (
    TRAININGS,
    coefficients_of,
    train_pairs_steps,
)
from prt_core.compress.dictionaries.reflections import LEAST_BITS, MOST_BITS
from prt_core.compress.dictionaries.sparsity import Sparsity
from prt_core.compress.parameters import expect_optional
from prt_core.errors import expect_number, expect_one_of, expect_seed, expect_whole
from prt_core.lightfield.clustering import spread_subset
from prt_core.lightfield.pairs import LearnedPairs

# Coefficients while training, where their number is not given.
_N_TRAINING = 24


class CEOB(LearnedPairs):
    """HRDFs in pairs of orthonormal bases that are learned from them, a few pairs a cluster.

    Parameters
    ----------
    n_coefficients : int, optional
        At most so many an HRDF.
    threshold : float, optional
        One for the whole object: coefficients that are not larger are left out.
    error : float, optional
        The L2 error allowed to each HRDF, as published, instead of a threshold.
    n_pairs : int
        Of each cluster.
    training : {"hard", "annealed"}
        Binary memberships begun by k-means, or annealed ones as published.
    n_training : int, optional
        Coefficients while training; default: `n_coefficients`, or 24.
    share : float
        Of each cluster's HRDFs that train, drawn by k-means++.
    bits : int
        Of each number of the dictionary, 6 to 16.
    seed : int
    """

    def __init__(
        self,
        n_coefficients=None,
        threshold=None,
        error=None,
        n_pairs=16,
        training="hard",
        n_training=None,
        share=0.8,
        bits=10,
        seed=0,
    ):
        self.n_coefficients = n_coefficients
        self.threshold = threshold
        self.error = error
        self.n_pairs = n_pairs
        self.training = training
        self.n_training = n_training
        self.share = share
        self.bits = bits
        self.seed = seed

    def sparsity(self):
        return Sparsity(self.n_coefficients, self.threshold, self.error)

    def expect_params(self):
        self.sparsity()
        expect_whole("n_pairs", self.n_pairs, 1, 1 << 12)
        expect_one_of("training", self.training, TRAININGS)
        expect_optional("n_training", self.n_training, 1)
        expect_number("share", self.share, above=0, most=1)
        expect_whole("bits", self.bits, LEAST_BITS, MOST_BITS)
        expect_seed(self.seed)
        return self

    def for_chroma(self):
        # Chroma follows luma and takes few coefficients: a quarter of the pairs serves it.
        params = {"n_pairs": -(-self.n_pairs // 4)}
        if self.n_training is not None:
            params["n_training"] = -(-self.n_training // 2)
        return super().for_chroma().set_params(**params)

    def halved(self):
        return self.clone().set_params(n_pairs=self.n_pairs // 2) if self.n_pairs > 1 else None

    def train_steps(self, hrdfs, labels):
        self.expect_params()
        self.shape_ = hrdfs.shape[1:]
        sparsity = Sparsity(self.n_training or self.n_coefficients or _N_TRAINING)
        pairs, counts = [], []
        for cluster in range(int(labels.max()) + 1):
            members = hrdfs[labels == cluster]
            members = members[spread_subset(members, self.share, self.seed)]
            left, right = yield from train_pairs_steps(
                members, self.n_pairs, sparsity, self.training, self.seed
            )
            counts.append(len(left))
            pairs += _by_use(members, list(zip(left, right, strict=True)), sparsity)
        self.first_ = np.concatenate([[0], np.cumsum(counts)])
        self._round_pairs(pairs)


def _by_use(members, pairs, sparsity):
    """Pairs whose columns stand in the order of the energy that they take."""
    energies = [np.zeros(basis.shape[1]) for pair in pairs for basis in pair]
    least = np.full(len(members), np.inf)
    best = np.zeros(len(members), int)
    for a, pair in enumerate(pairs):
        rows = coefficients_of(members, pair).reshape(len(members), -1)
        cost = sparsity.cost(rows, sparsity.kept(rows))
        best[cost < least] = a
        least = np.minimum(least, cost)
    result = []
    for a, (left, right) in enumerate(pairs):
        rows = coefficients_of(members[best == a], (left, right)).reshape(-1, members[0].size)
        kept = np.where(sparsity.kept(rows), rows, 0).reshape(-1, len(left), len(right))
        energy = np.square(kept, dtype=np.float64).sum(axis=0)
        energies = energy.sum(axis=1), energy.sum(axis=0)
        orders = [np.argsort(-each, kind="stable") for each in energies]
        result.append((left[:, orders[0]], right[:, orders[1]]))
    return result
