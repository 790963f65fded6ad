"""How deep each column is transformed (Cheslack-Postava et al. 2007, section 4.2).

A step pays as long as it needs fewer terms for the same error. Of all depths the one with the
least `error + limit * terms` is taken, where a term is kept if its square is above `limit`: for an
orthonormal transform this is the least error that so many terms allow, over all columns at once.
"""

import numpy as np


def transform_to_best(transform, columns, limit, least=0, most=None):
    """Each column to the depth that is best for it, in place.

    Parameters
    ----------
    transform : ImageWavelet, PointHaar or PointMultiwavelet
    columns : (m, n) float32, in the order of the transform
        Their coefficients, afterwards.
    limit : float
        Square of the smallest term that is kept.
    least, most : int
        Depths that are allowed; default: all.

    Returns
    -------
    depths : (m,) int
        All of them are tried, for the gain need not fall with every step.
    costs : (m,) float64
        `error + limit * terms` of each column.
    """
    most = transform.depth if most is None else most
    details, costs, heads = 0.0, [], []
    for depth in range(most + 1):
        weights = None
        if depth:
            transform.forward_step(columns, depth - 1)
        if not transform.orthonormal:
            weights = transform.weights(depth)[None]
        head = transform.head(columns, depth)
        cost = _cost(head, limit, weights is not None and transform.head(weights, depth))
        if depth:
            whole = transform.head(columns, depth - 1)
            weights = weights is not None and transform.head(weights, depth - 1)
            details = details + _cost(whole, limit, weights) - cost
        costs.append(details + cost if depth >= least else np.full(len(columns), np.inf))
        heads.append(head.copy() if least <= depth < most else None)
    # Rounding errors must not send an untouched column down.
    costs = np.array(costs)
    depths = np.argmax(costs <= costs.min(axis=0) * (1 + 1e-6), axis=0)
    for depth in range(least, most):
        mine = np.flatnonzero(depths == depth)
        if len(mine):
            transform.head(columns, depth)[mine] = heads[depth][mine]
    return depths, costs.min(axis=0)


def transform_to_better(one, other, columns, limit, least=0, most=None):
    """Each column by the better of two orthonormal transforms, in place.

    Parameters
    ----------
    one, other : PointMultiwavelet, PointHaar
        Of the same order.
    columns, limit, least, most
        See `transform_to_best`.

    Returns
    -------
    (m,) int
        The depths; below zero where it is the other transform.
    """
    again = columns.copy()
    depths, costs = transform_to_best(one, columns, limit, least, most)
    others, other_costs = transform_to_best(other, again, limit, least, most)
    better = other_costs < (1 - 1e-6) * costs
    columns[better] = again[better]
    return np.where(better, -others, depths)


def invert_from(transform, coefficients, depths):
    """Undo `transform_to_best`, in place."""
    for depth in np.unique(depths):
        mine = depths == depth
        part = coefficients[mine]
        for level in reversed(range(depth)):
            transform.inverse_step(part, level)
        coefficients[mine] = part
    return coefficients


def _cost(part, limit, weights):
    """(m,) float64: of every coefficient what is cheaper, its error or to keep it."""
    squares = part * part
    if weights is not False:
        squares *= weights
    np.minimum(squares, np.float32(limit), out=squares)
    return squares.reshape(len(part), -1).sum(axis=1, dtype=np.float64)
