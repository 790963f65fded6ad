"""The batched L1 solver against a loop over scikit-learn's Lasso, on the same problems.

python tests/benchmarks/l1_solvers.py [SCENE]

2,000 sparse points of a measuring scene with 40 neighbours and 350 directions each: the problems
that the sampler really solves. Both are timed in one process, on one thread, in CPU seconds, with
the Gram matrices; scikit-learn at its own tolerance, and at the one that its objectives need to be
within 1e-6 of the minimum. Its part is measured on some of the problems and scaled up.
"""

import sys
import time
import warnings
from pathlib import Path

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import Lasso
from threadpoolctl import threadpool_limits

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from prt_core.reconstruct import gram, l1_batched, l1_interior_point  # noqa: E402
from prt_core.sampling.huang import HuangSettings  # noqa: E402
from tests.benchmarks.huang_tables import Sparse  # noqa: E402

N_PROBLEMS, SOME = 2000, 60


def problems(name):
    """(n, 40, 350) columns and (n, 350) targets, as `SparsePoints` makes them."""
    import prt_core.sampling.sparse as module

    settings = HuangSettings(neighbours=40, radius=0.2)
    sparse, kept = Sparse(name, settings), []

    def keeping(columns, targets):
        kept.append((columns, targets))
        return gram(columns, targets)

    original, module.gram = module.gram, keeping
    try:
        sparse.measure(settings, 0)
    finally:
        module.gram = original
    whole = [pair for pair in kept if pair[0].shape[1:] == (40, 350)]
    columns, targets = (np.concatenate(parts)[:N_PROBLEMS] for parts in zip(*whole, strict=True))
    return columns.astype(np.float64), targets.astype(np.float64)


def objectives(columns, targets, strengths, weights):
    residual = targets - np.einsum("nkm,nk->nm", columns, weights)
    return (residual**2).sum(axis=1) / 2 + strengths * np.abs(weights).sum(axis=1)


def loop(columns, targets, strengths, tolerance):
    """CPU seconds a problem, and the weights."""
    start, weights = time.process_time(), []
    for a, y, strength in zip(columns, targets, strengths, strict=True):
        model = Lasso(strength / len(y), fit_intercept=False, tol=tolerance, max_iter=50_000)
        weights.append(model.fit(a.T, y).coef_)
    return (time.process_time() - start) / len(columns), np.array(weights)


def main():
    columns, targets = problems(sys.argv[1] if len(sys.argv) > 1 else "dancer")
    n = len(columns)
    print(f"{n:,} problems, {columns.shape[2]} constraints, {columns.shape[1]} unknowns")
    print("lambda/max  gram s  solve s  iterations  largest gap/|y|^2  non-zero   "
          "sklearn ms at 1e-4 (excess)   at 1e-7 (excess)   ratio at 1e-4, 1e-7")  # fmt: skip
    rows = np.linspace(0, n - 1, SOME).astype(int)
    for share in (1e-1, 1e-2, 1e-3):
        times = []
        for _ in range(3):
            start = time.process_time()
            grams, moments, squares = gram(columns, targets)
            middle = time.process_time()
            strengths = np.maximum(share * np.abs(moments).max(axis=1), 1e-30)
            result = l1_batched(grams, moments, squares, strengths)
            times.append((middle - start, time.process_time() - middle))
        built, solved = np.median(times, axis=0)
        subset = columns[rows], targets[rows], strengths[rows]
        best = objectives(*subset, result.weights[rows])
        cells, ratios = [], []
        for tolerance in (1e-4, 1e-7):
            spent, weights = loop(*subset, tolerance)
            excess = (objectives(*subset, weights) / np.maximum(best, 1e-300) - 1).max()
            cells.append(f"{1e3 * spent:9.2f} ({excess:.1e})")
            ratios.append(f"{spent * n / (built + solved):.1f}")
        gap = (result.gap / np.maximum(squares, 1e-300)).max()
        print(
            f"{share:10g} {built:7.3f} {solved:8.3f} {result.iterations.mean():11.1f} "
            f"{gap:18.1e} {np.count_nonzero(result.weights) / n:9.1f}   {'   '.join(cells)}   "
            f"{', '.join(ratios)}",
            flush=True,
        )
    one = l1_interior_point(columns[0], targets[0], strengths[0])
    print(f"interior point, first problem: {one.objective:.9g}, gap {one.gap:.1e}, "
          f"batched {result.objective[0]:.9g}")  # fmt: skip


if __name__ == "__main__":
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        main()
