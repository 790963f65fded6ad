"""Sparse least squares by an interior-point method (Kim, Koh, Lustig, Boyd & Gorinevsky 2007).

    minimise over w   1/2 |A w - y|^2 + lambda |w|_1

Bounds -u < w < u turn the absolute values into a smooth problem with a logarithmic barrier, whose
minimum is followed by Newton steps while the barrier becomes steeper. A dual point made from the
residual gives the duality gap at every step. One problem at a time: the readable reference beside
`l1_batched`, and the solver for problems whose Gram matrix is too large to keep.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse.linalg import LinearOperator, cg

from prt_core.errors import expect_array, expect_number, expect_one_of, expect_whole

# The paper's: shrinking of a step, slope it must reach, growth of the barrier.
_ALPHA, _BETA, _MU, _LEAST_STEP = 0.01, 0.5, 2.0, 0.5
# Unknowns from which on the Newton system is solved by conjugate gradients.
_LARGE = 1000
# Values beyond leave nothing of float64's precision where they are squared.
_LARGEST = 1e15


@dataclass
class L1Solution:
    """Weights (k,), their objective, its duality gap, and the Newton steps taken."""

    weights: np.ndarray
    objective: float
    gap: float
    iterations: int


def l1_interior_point(columns, target, strength, tolerance=1e-8, most_iterations=200, solver=None):
    """Solve one sparse least-squares problem.

    Parameters
    ----------
    columns : (k, m) float
        A, transposed.
    target : (m,) float
    strength : float
        lambda > 0; from `|A^T y|_max` on the solution is zero.
    tolerance : float
        Wanted duality gap, as a share of |y|^2 / 2, the objective of zero.
    most_iterations : int
    solver : {"cholesky", "pcg"}, optional
        Of the Newton system; default: by size.

    Returns
    -------
    L1Solution
    """
    a = expect_array("columns", columns, (None, None), np.float64, -_LARGEST, _LARGEST).T
    y = expect_array("target", target, (len(a),), np.float64, -_LARGEST, _LARGEST)
    strength = expect_number("strength", strength, above=0)
    tolerance = expect_number("tolerance", tolerance, above=0)
    most_iterations = expect_whole("most_iterations", most_iterations, 1)
    k = a.shape[1]
    if solver is not None:
        expect_one_of("solver", solver, ("cholesky", "pcg"))
    solver = solver or ("cholesky" if k < _LARGE else "pcg")
    gram = a.T @ a if solver == "cholesky" else None
    w, u, t = np.zeros(k), np.ones(k), 1 / max(strength, 1e-300)
    diagonal = np.einsum("mk,mk->k", a, a)
    step, way_before, iteration = np.inf, None, 0
    best = L1Solution(w, y @ y / 2, np.inf, 0)
    for iteration in range(most_iterations):
        residual = a @ w - y
        objective = residual @ residual / 2 + strength * np.abs(w).sum()
        slope = a.T @ residual
        gap = objective - _dual(residual, slope, y, strength)
        if gap < best.gap:
            best = L1Solution(w, float(objective), float(max(gap, 0)), iteration)
        if gap <= tolerance * (y @ y) / 2:
            break
        if step >= _LEAST_STEP:
            t = max(min(2 * k * _MU / max(gap, 1e-300), _MU * t), t)
        way, way_u = _newton(a, gram, diagonal, w, u, t, slope, strength, solver, way_before, gap)
        way_before = way
        step = _line_search(a, y, w, u, t, strength, way, way_u)
        if step == 0:
            break
        w, u = w + step * way, u + step * way_u
    best.iterations = iteration
    return best


def _dual(residual, slope, y, strength):
    """Value of the dual at the residual, scaled into |A^T nu| <= lambda (equation 9)."""
    steepest = np.abs(slope).max(initial=0)
    nu = residual * min(1.0, strength / max(steepest, 1e-300))
    return -(nu @ nu) / 2 - nu @ y


def _newton(a, gram, diagonal, w, u, t, slope, strength, solver, start, gap):
    """The Newton step of the barrier problem; u is eliminated, k unknowns are left."""
    q1, q2 = 1 / (u + w), 1 / (u - w)
    d1, d2 = q1**2 + q2**2, q1**2 - q2**2
    gradient_w = t * slope - q1 + q2
    gradient_u = t * strength - q1 - q2
    rest = d1 - d2 * d2 / d1
    right = -gradient_w + d2 / d1 * gradient_u
    if solver == "cholesky":
        system = t * gram
        system[np.diag_indices_from(system)] += rest
        way = cho_solve(cho_factor(system, check_finite=False), right, check_finite=False)
    else:
        k = len(w)
        scale = 1 / (t * diagonal + rest)
        operator = LinearOperator((k, k), lambda v: t * (a.T @ (a @ v)) + rest * v)
        condition = LinearOperator((k, k), lambda v: scale * v)
        accuracy = min(1e-1, 0.3 * gap / max(1.0, np.linalg.norm(right)))
        way, _ = cg(operator, right, x0=start, rtol=accuracy, maxiter=5000, M=condition)
    return way, -(gradient_u + d2 * way) / d1


def _line_search(a, y, w, u, t, strength, way, way_u):
    """The first of 1, 1/2, 1/4, … that stays inside the bounds and falls enough; 0 if none does."""

    def value(w, u):
        residual = a @ w - y
        smooth = residual @ residual / 2 + strength * u.sum()
        return t * smooth - np.log(u + w).sum() - np.log(u - w).sum()

    before = value(w, u)
    q1, q2 = 1 / (u + w), 1 / (u - w)
    slope = (t * (a.T @ (a @ w - y)) - q1 + q2) @ way + (t * strength - q1 - q2) @ way_u
    step = 1.0
    for _ in range(60):
        new_w, new_u = w + step * way, u + step * way_u
        inside = (new_u > np.abs(new_w)).all()
        if inside and value(new_w, new_u) - before <= _ALPHA * step * slope:
            return step
        step *= _BETA
    return 0.0
