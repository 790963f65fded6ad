"""The gather operator K from where rays ended: `K[x, y]` is the share of x's rays that ended at y.

Unbiased, and one non-zero a ray at most. How much of its sky is blocked a point knows from its
visibility, far better than from some dozen rays. So a row is scaled until its rays meet something
as often as that: what is left to chance is what they meet, not how many do.
"""

import numpy as np
import scipy.sparse as sp

from prt_core.errors import expect, expect_array, expect_whole
from prt_core.transport.gather import NOT_CAST, REPRESENTED, ROUND
from prt_core.transport.sharing import DARK, MISS

# Rays of a row that should meet something, at least, for the row to be scaled.
_ENOUGH = 2
# Of weights, and of what they add up to: rows stay numbers of float32.
_MOST = 1e30


def ray_ends(hits):
    """What every ray of a row stands for: `hits` without those that stand for others.

    Parameters
    ----------
    hits : (n, n_rounds * ROUND) int32
        See `Gathered`.

    Returns
    -------
    (n, n_rounds * ROUND) int32
        Bake points, MISS, DARK or NOT_CAST.

    Raises
    ------
    PRTError
        A ray stands for one that does so itself, or for none.
    """
    represented = hits <= REPRESENTED
    if represented.any():
        slot = np.arange(hits.shape[1])
        representative = np.where(
            represented, slot - slot % ROUND + REPRESENTED - hits.astype(np.int64), slot
        )
        good = hits.min() > REPRESENTED - ROUND and hits.shape[1] % ROUND == 0
        hits = np.take_along_axis(hits, representative, axis=1) if good else hits
    expect(
        not hits.size or hits.min() >= DARK or _whole_rounds(hits),
        f"hits: expected points, {MISS}, {DARK}, {NOT_CAST} in all {ROUND} slots of a round, or "
        f"{REPRESENTED} and less for the slot of a ray of the same {ROUND} that was cast, got "
        "something else",
    )
    return hits


def _whole_rounds(ends):
    """Whether of rays that end nowhere none of a round was cast."""
    if ends.min() < NOT_CAST or ends.shape[1] % ROUND:
        return False
    left = (ends == NOT_CAST).reshape(len(ends), -1, ROUND)
    return bool((left.any(axis=2) == left.all(axis=2)).all())


def gather_operator(hits, n_points, blocked=None, weights=None):
    """K from hits: (n, n_points) CSR float32, each row sums to the share of its rays that hit.

    With `weights`, K of another term of the reflectance than the diffuse one: what a ray brings
    counts by its weight,

        K[x, y] = 1 / n_rays * sum of weights[x, i] over the rays i of x that ended at y,

    where a ray weighs as much as the term's in-factor (its cosine included) at the ray's direction,
    divided by the density with which that was chosen, cosine / pi (see `gather_directions`). A
    diffuse term, cosine / pi, weighs 1, and gives K as it is without weights, bit for bit. A ray
    that was not cast ends where the one ends that stands for it, but has its own direction, and so
    its own weight.

    Parameters
    ----------
    hits : (n, n_rounds * ROUND) int32
        Of any number of rounds side by side (see `Gathered`).
    n_points : int
    blocked : (n,) float32, optional
        What each point would receive if all that is in the way had radiance 1: the integral of the
        in-factor over the directions in which something is, without weights the share of the
        cosine-weighted hemisphere. Rows are scaled until they meet as much (see `_scale`).
    weights : (n, n_rounds * ROUND) float, optional
        Of each ray, in the order of the hits, not negative; default: 1.

    Returns
    -------
    (n, n_points) CSR float32
        Without entries that are 0.

    Raises
    ------
    PRTError
        Shapes that do not fit each other; hits that lead nowhere; weights that are negative or not
        finite.
    """
    n_points = expect_whole("n_points", n_points, 1, np.iinfo(np.int32).max)
    hits = expect_array("hits", hits, (None, None), np.int32, most=n_points - 1)
    expect(hits.size, "hits: expected at least one ray")
    n, n_rays = hits.shape
    if weights is not None:
        weights = expect_array("weights", weights, hits.shape, None, 0, _MOST)
    if blocked is not None:
        most = 1 if weights is None else _MOST
        blocked = expect_array("blocked", blocked, (n,), np.float32, 0, most)
    hits = ray_ends(hits)
    cast = hits != NOT_CAST
    n_cast = np.count_nonzero(cast, axis=1)
    expect(n_cast.all(), "hits: expected at least one ray of every point that was cast")
    if weights is not None and n_cast.min() < n_rays:
        weights = np.where(cast, weights, 0)
    if weights is None:
        hits = np.sort(hits, axis=1)
    else:
        order = np.argsort(hits, axis=1, kind="stable")
        hits, weights = (np.take_along_axis(x, order, axis=1) for x in (hits, weights))
    first = np.ones(hits.shape, bool)
    first[:, 1:] = hits[:, 1:] != hits[:, :-1]
    start = np.flatnonzero(first)
    columns = hits.ravel()[start]
    if weights is None:
        sums = np.diff(np.append(start, hits.size))
    else:
        sums = np.add.reduceat(weights.ravel(), start, dtype=np.float64)
    kept = (columns >= 0) & (sums > 0)
    row = start[kept] // n_rays
    pointer = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=n))]).astype(np.int64)
    data = (sums[kept] / n_cast[row]).astype(np.float32)
    if blocked is not None:
        with np.errstate(over="ignore"):
            data *= _scale(hits, n_cast, weights, blocked)[row].astype(np.float32)
        expect(
            np.isfinite(data).all(),
            "blocked: expected what the weights add up to where something is in the way, "
            "got far more than that",
        )
    return sp.csr_matrix((data, columns[kept], pointer), shape=(n, n_points))


def _scale(hits, n_cast, weights, blocked):
    """(n,) float64: what makes each row meet as much as is blocked.

    A ratio estimate (Cochran 1977, section 6): of n rays with weights w those that met something
    sum to m = sum(w of them) / n, whose mean over all choices of rays is `blocked`. Where m is too
    large, by chance, so is the light that the row gathers; so rows are scaled by blocked / m. The
    light is w times radiance, and m has to have the same w: scaled by how many rays met something,
    whatever they weigh, a narrow lobe would gain noise and no truth.

    Rows of which few rays tell anything are left as they are, unbiased: those that should meet
    something, blocked * n of n where all weigh 1. Where they do not, n rays are as good as
    sum(w)^2 / sum(w^2) (Kish 1965), of which the share blocked / (sum(w) / n), or all of them,
    should meet something: blocked * n * sum(w) / sum(w^2).
    """
    met = (hits != MISS) & (hits != NOT_CAST)
    if weights is None:
        telling = blocked * n_cast
        met = np.maximum(np.count_nonzero(met, axis=1), 1) / n_cast
    else:
        weights = weights.astype(np.float64, copy=False)
        total, squares = weights.sum(axis=1), (weights**2).sum(axis=1)
        part = total / np.maximum(squares, np.finfo(np.float64).tiny)
        telling = np.minimum(blocked * n_cast * part, total * part)
        met = np.where(met, weights, 0).sum(axis=1) / n_cast
        met[met == 0] = 1
    return np.where(telling >= _ENOUGH, blocked / met, 1)
