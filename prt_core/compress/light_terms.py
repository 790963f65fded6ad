"""The few terms of a light that its colours need (after Ng et al. 2003)."""

import numpy as np


def heaviest(weight, most=None, error=0.0):
    """The terms that weigh most.

    Parameters
    ----------
    weight : (n,) float
        Squares of what each term is expected to add to the colours.
    most : int, optional
        So many at most.
    error : float
        The least of these are left out while their share of the colours stays below this.

    Returns
    -------
    (k,) int
        Sorted; terms without weight are never among them.
    """
    best = np.flatnonzero(weight)
    if most is not None and most < len(best):
        best = best[np.argpartition(weight[best], -most)[-most:]]
    best = best[np.argsort(weight[best])]
    # Errors of different terms are as good as independent: their squares add up.
    n_spare = np.searchsorted(np.cumsum(weight[best]), error**2 * weight.sum())
    return np.sort(best[min(n_spare, len(best) - 1) :]) if len(best) else best
