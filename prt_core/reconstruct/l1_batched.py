"""Many small sparse least-squares problems at once.

    minimise over w   1/2 |A w - y|^2 + lambda |w|_1          for each of n problems

By feature-sign search (Lee, Battle, Raina & Ng 2007): guess which weights are not zero and their
signs, solve the quadratic that is left exactly, walk towards its minimum as far as the objective
falls, and go on until the optimality conditions hold. Here each step is done for all problems that
are not finished together, on their Gram matrices, and weights enter several at a time.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_array, expect_whole

# A solution is final when each optimality condition holds to this share of lambda.
_SLACK = 1e-7
# Added to the diagonal, relative: equal columns then share their weight.
_RIDGE = 1e-11
# Weights that may enter at once.
_MOST = 8
_CHUNK = 512
_FEW = 16


@dataclass
class L1Solutions:
    """Solutions of n problems and how far from the minimum each may be.

    Attributes
    ----------
    weights : (n, k) float64
    objective, gap : (n,) float64
        The objective, and its duality gap: the minimum lies within `gap` below.
    iterations : (n,) int32
    """

    weights: np.ndarray
    objective: np.ndarray
    gap: np.ndarray
    iterations: np.ndarray


def gram(columns, targets):
    """What the solver needs of n problems.

    Parameters
    ----------
    columns : (n, k, m) float
        A of each problem, transposed: its k columns.
    targets : (n, m) float

    Returns
    -------
    grams : (n, k, k), moments : (n, k), squares : (n,) float64
        A^T A, A^T y and |y|^2.
    """
    columns = expect_array("columns", columns, (None, None, None))
    n, k, m = columns.shape
    targets = expect_array("targets", targets, (n, m))
    grams, moments = np.empty((n, k, k)), np.empty((n, k))
    targets = np.asarray(targets, np.float64)
    # A few problems at a time, so that their float64 copies stay in the cache.
    for first in range(0, n, _FEW):
        part = slice(first, first + _FEW)
        wide = np.asarray(columns[part], np.float64)
        np.matmul(wide, wide.transpose(0, 2, 1), out=grams[part])
        moments[part] = (wide @ targets[part, :, None])[:, :, 0]
    return grams, moments, np.einsum("nm,nm->n", targets, targets)


def l1_batched(grams, moments, squares, strengths, start=None, most_iterations=400):
    """Solve n sparse least-squares problems from their Gram matrices.

    Parameters
    ----------
    grams : (n, k, k) float64
    moments : (n, k) float64
    squares : (n,) float64
        See `gram`. Columns of zeros are allowed, as are equal ones, and k larger than the rank.
    strengths : (n,) float64
        lambda of each problem, > 0.
    start : (n, k) float64, optional
        Weights to begin from.
    most_iterations : int

    Returns
    -------
    L1Solutions
    """
    grams, moments = expect_problems(grams, moments)
    n, k = moments.shape
    squares = expect_array("squares", squares, (n,), np.float64)
    strengths = expect_array("strengths", strengths, (n,), np.float64)
    expect((strengths > 0).all(), "strengths: expected numbers above 0")
    most_iterations = expect_whole("most_iterations", most_iterations, 1)
    weights = np.zeros((n, k))
    if start is not None:
        weights = np.array(expect_array("start", start, (n, k), np.float64))
    iterations = np.zeros(n, np.int32)
    for first in range(0, n, _CHUNK):
        part = slice(first, first + _CHUNK)
        weights[part], iterations[part] = _search(
            grams[part], moments[part], strengths[part], weights[part], most_iterations
        )
    objective, gap = l1_certificate(grams, moments, squares, strengths, weights)
    return L1Solutions(weights, objective, gap, iterations)


def expect_problems(grams, moments):
    """(n, k, k) and (n, k) float64 of n problems (see `gram`)."""
    moments = expect_array("moments", moments, (None, None), np.float64)
    n, k = moments.shape
    return expect_array("grams", grams, (n, k, k), np.float64), moments


def l1_certificate(grams, moments, squares, strengths, weights):
    """Objective and duality gap of any weights.

    The dual point is the residual scaled into |A^T nu| <= lambda (Kim et al. 2007, equation 9).

    Parameters
    ----------
    grams, moments, squares, strengths
        As `l1_batched` takes them.
    weights : (n, k) float64

    Returns
    -------
    objective, gap : (n,) float64
    """
    grams, moments = expect_problems(grams, moments)
    n, k = moments.shape
    squares = expect_array("squares", squares, (n,), np.float64)
    strengths = expect_array("strengths", strengths, (n,), np.float64)
    weights = expect_array("weights", weights, (n, k), np.float64)
    product = np.einsum("nij,nj->ni", grams, weights)
    slope = moments - product
    fitted = np.einsum("ni,ni->n", moments, weights)
    residual = squares - 2 * fitted + np.einsum("ni,ni->n", product, weights)
    objective = residual / 2 + strengths * np.abs(weights).sum(axis=1)
    steepest = np.abs(slope).max(axis=1, initial=0)
    scale = np.minimum(1, strengths / np.maximum(steepest, 1e-300))
    dual = scale * (squares - fitted) - scale**2 * residual / 2
    return objective, np.maximum(objective - dual, 0)


def _search(grams, moments, strengths, weights, most_iterations):
    n, k = moments.shape
    diagonal = np.einsum("nii->ni", grams)
    size = np.maximum(diagonal.max(axis=1), 1e-300)
    result, iterations = weights.copy(), np.zeros(n, np.int32)
    entering = np.full(n, min(k, _MOST))
    state = _State(np.arange(n), grams, moments, strengths, weights, entering, size)
    for iteration in range(most_iterations):
        open_ = state.grow()
        if not open_.all():
            state.leave(result, iterations, iteration, ~open_)
            state = state.only(open_)
        if not len(state.index):
            break
        state.step()
    if len(state.index):
        state.leave(result, iterations, most_iterations, np.ones(len(state.index), bool))
    return result, iterations


class _State:
    """The problems that are not finished, one row each."""

    def __init__(self, index, grams, moments, strengths, weights, entering, size):
        self.index, self.grams, self.moments = index, grams, moments
        self.strengths, self.weights, self.entering, self.size = strengths, weights, entering, size
        self.slope = moments - np.einsum("nij,nj->ni", grams, weights)
        self.arrived = ~weights.any(axis=1)

    def only(self, keep):
        """The rows `keep`, with the signs of their last `grow`."""
        names = "index grams moments strengths weights entering size".split()
        state = _State.__new__(_State)
        for name in (*names, "slope", "signs", "arrived"):
            setattr(state, name, getattr(self, name)[keep])
        return state

    def leave(self, result, iterations, iteration, rows):
        result[self.index[rows]] = self.weights[rows]
        iterations[self.index[rows]] = iteration

    def grow(self):
        """Choose the active weights and their signs; (n,) bool: which problems go on."""
        signs = np.sign(self.weights)
        active = signs != 0
        slack = _SLACK * self.strengths[:, None]
        pull = np.abs(self.slope) - self.strengths[:, None]
        violating = np.where(active, -np.inf, pull)
        order = np.argsort(-violating, axis=1)[:, : int(self.entering.max())]
        highest = np.take_along_axis(violating, order, axis=1)
        enter = highest > np.maximum(slack, 0.5 * highest[:, :1])
        enter &= np.arange(order.shape[1]) < self.entering[:, None]
        going = ~self.arrived | enter[:, 0]
        enter &= (self.arrived | (self.entering > 1))[:, None]
        row, column = np.nonzero(enter)
        column = order[row, column]
        signs[row, column] = np.sign(self.slope[row, column])
        self.signs = signs
        return going

    def step(self):
        """Solve for the active weights, and go as far towards them as the objective falls."""
        active = self.signs != 0
        width = int(active.sum(axis=1).max())
        place = np.argsort(~active, axis=1, kind="stable")[:, :width]
        valid = np.take_along_axis(active, place, axis=1)
        rows = np.arange(len(place))[:, None]
        small = self.grams[rows[:, :, None], place[:, :, None], place[:, None, :]]
        both = valid[:, :, None] & valid[:, None, :]
        small = np.where(both, small, 0)
        ridge = np.where(valid, _RIDGE * self.size[:, None], 1)
        solved = small.copy()
        diagonal = np.arange(width)
        solved[:, diagonal, diagonal] += ridge
        signs = np.where(valid, np.take_along_axis(self.signs, place, axis=1), 0)
        here = np.where(valid, np.take_along_axis(self.weights, place, axis=1), 0)
        wanted = np.take_along_axis(self.moments, place, axis=1) - self.strengths[:, None] * signs
        target = np.linalg.solve(solved, np.where(valid, wanted, 0)[:, :, None])[:, :, 0]
        slope = np.where(valid, np.take_along_axis(self.slope, place, axis=1), 0)
        moved, fell, whole = _walk(small, slope, self.strengths, here, target - here)
        # An entering weight that goes against its sign makes the objective rise: then fewer enter
        # the next time. One alone, all others being settled, always goes its way.
        fell &= ~((here == 0) & ((target - here) * signs < 0)).any(axis=1)
        self.entering = np.where(fell, np.minimum(2 * self.entering, _MOST), self.entering // 4)
        self.entering = np.maximum(self.entering, 1)
        moved = np.where(fell[:, None], moved, here)
        # What the active weights had reached stays reached where nothing moved.
        self.arrived = np.where(fell, whole, self.arrived)
        weights = np.zeros_like(self.weights)
        np.put_along_axis(weights, place, np.where(valid, moved, 0), axis=1)
        self.weights = weights
        self.slope = self.moments - np.einsum("nij,nj->ni", self.grams, weights)


def _walk(grams, slope, strengths, here, way):
    """The best of the end of `way` and the places on it where a weight becomes zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -here / way
    crossing = np.where((here != 0) & (crossing > 0) & (crossing < 1), crossing, 1)
    steps = np.concatenate([crossing, np.ones((len(here), 1))], axis=1)
    linear = -np.einsum("na,na->n", slope, way)
    square = np.einsum("na,nab,nb->n", way, grams, way, optimize=True)
    sizes = np.abs(here[:, None] + steps[:, :, None] * way[:, None]).sum(axis=2)
    change = linear[:, None] * steps + square[:, None] * steps**2 / 2
    change += strengths[:, None] * (sizes - np.abs(here).sum(axis=1)[:, None])
    # No crossing is the whole way.
    change[:, :-1][crossing == 1] = np.inf
    best = change.argmin(axis=1)
    rows = np.arange(len(here))
    step = steps[rows, best][:, None]
    moved = here + step * way
    # What crosses zero just there is zero, not a rounding of it.
    moved[(crossing == step) & (crossing < 1)] = 0
    # A weight of the size of rounding errors leaves without the objective falling.
    even = 1e-13 * strengths * np.abs(here).sum(axis=1)
    # Settled is what went the whole way and kept its signs.
    return moved, change[rows, best] <= even, (crossing == 1).all(axis=1)
