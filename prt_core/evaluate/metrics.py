"""Errors of relit colours against a truth."""

import numpy as np

from prt_core.errors import expect


def colour_error(colours, truth, weights=None):
    """Relative L2 and relative error of the mean.

    Parameters
    ----------
    colours, truth : (n, 3) float
    weights : (n,) float, optional
        Areas; default: all alike, as the papers count.

    Returns
    -------
    dict
        `l2`: sqrt(sum |c - t|^2 / sum |t|^2); `mean`: mean(c) / mean(t) - 1.
    """
    colours, truth = np.asarray(colours, np.float64), np.asarray(truth, np.float64)
    expect(
        colours.shape == truth.shape, f"truth: expected shape {colours.shape}, got {truth.shape}"
    )
    w = np.ones(len(truth)) if weights is None else np.asarray(weights, np.float64)
    power = (w[:, None] * truth**2).sum()
    mean = (w[:, None] * truth).sum()
    return {
        "l2": float(np.sqrt((w[:, None] * (colours - truth) ** 2).sum() / max(power, 1e-300))),
        "mean": float((w[:, None] * colours).sum() / max(mean, 1e-300) - 1),
    }
