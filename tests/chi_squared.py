"""Whether a sampler of directions falls as densely as its pdf says, by a chi-squared test."""

import numpy as np
from scipy.stats import chi2

from prt_core.sphere import tangent_frames

# Cells around a pole: rings that are finer near it, and sectors of each.
_RINGS = np.concatenate([[0], np.geomspace(1e-5, 1, 28), np.linspace(1, 2, 9)[1:]])
_SECTORS = np.linspace(-np.pi, np.pi, 17)


def around(pole):
    """Nodes (n_cells, n_nodes, 3) over the whole sphere about a direction, and their weights."""
    nodes, weights = np.polynomial.legendre.leggauss(10)
    cap = (_RINGS[:-1, None] + _RINGS[1:, None] + np.diff(_RINGS)[:, None] * nodes) / 2
    turn = (_SECTORS[:-1, None] + _SECTORS[1:, None] + np.diff(_SECTORS)[:, None] * nodes) / 2
    cap, turn = np.broadcast_arrays(cap[:, None, :, None], turn[None, :, None, :])
    flat = np.sqrt(cap * (2 - cap))
    local = np.stack([flat * np.cos(turn), flat * np.sin(turn), 1 - cap], axis=-1)
    size = np.diff(_RINGS)[:, None] * np.diff(_SECTORS) / 4
    weights = size[..., None, None] * np.outer(weights, weights)
    n_cells = size.size
    directions = local @ tangent_frames(pole[None])[0]
    return directions.reshape(n_cells, -1, 3), weights.reshape(n_cells, -1)


def integral(function, pole):
    """Over the whole sphere, of a function (n, 3) -> (n, ...), finest about a direction."""
    nodes, weights = around(np.asarray(pole, np.float64))
    values = np.asarray(function(nodes.reshape(-1, 3)))
    return np.tensordot(weights.ravel(), values, axes=1)


def chi_squared(sampler, pdf, pole, n=40_000, seed=4):
    """How likely samples that follow the pdf are as far off as these.

    Parameters
    ----------
    sampler : callable
        (n, 2) numbers from 0 to 1 -> (n, 3) unit vectors.
    pdf : callable
        (n, 3) -> (n,), over the whole sphere.
    pole : (3,) float
        Where most of the samples are.

    Returns
    -------
    p : float
    share : float
        What the pdf integrates to.
    """
    pole = np.asarray(pole, np.float64)
    nodes, weights = around(pole)
    expected = n * (pdf(nodes.reshape(-1, 3)).reshape(weights.shape) * weights).sum(axis=1)
    samples = sampler(np.random.default_rng(seed).random((n, 2)))
    local = samples @ tangent_frames(pole[None])[0].T
    # By the distance to the pole: exact where samples are close to it.
    cap = ((samples - pole) ** 2).sum(axis=-1) / 2
    turn = np.arctan2(local[:, 1], local[:, 0])
    counts = np.histogram2d(np.clip(cap, 0, 2), turn, [_RINGS, _SECTORS])[0].ravel()
    # Cells with few samples are counted together.
    order = np.argsort(expected)
    few = order[np.cumsum(expected[order]) < 5]
    rest = np.setdiff1d(order, few)
    rest = rest[expected[rest] >= 5]
    pooled = np.setdiff1d(np.arange(len(expected)), rest)
    observed = np.append(counts[rest], counts[pooled].sum())
    wanted = np.append(expected[rest], max(expected[pooled].sum(), 1e-9))
    if wanted[-1] < 5:
        assert observed[-1] < 20, "samples where the pdf is 0"
        observed, wanted = observed[:-1], wanted[:-1]
    statistic = ((observed - wanted) ** 2 / wanted).sum()
    return float(chi2.sf(statistic, len(wanted) - 1)), float(expected.sum() / n)
