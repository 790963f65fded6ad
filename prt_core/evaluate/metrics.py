"""Errors of relit colours against a truth."""

import numpy as np

from prt_core.errors import expect, expect_array
from prt_core.light.environment import BRIGHTEST


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
    colours = expect_array("colours", colours, (None, None), np.float64, -BRIGHTEST, BRIGHTEST)
    truth = expect_array("truth", truth, (None, None), np.float64, -BRIGHTEST, BRIGHTEST)
    expect(
        colours.shape == truth.shape, f"truth: expected shape {colours.shape}, got {truth.shape}"
    )
    w = np.ones(len(truth))
    if weights is not None:
        w = expect_array("weights", weights, (len(truth),), np.float64, 0, BRIGHTEST)
    power = (w[:, None] * truth**2).sum()
    mean = (w[:, None] * truth).sum()
    return {
        "l2": float(np.sqrt((w[:, None] * (colours - truth) ** 2).sum() / max(power, 1e-300))),
        "mean": float((w[:, None] * colours).sum() / max(mean, 1e-300) - 1),
    }
