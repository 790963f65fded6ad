"""The light between surfaces as a product of two thin matrices.

Indirect light varies slowly over points and directions, so its matrix has a low rank, and a
randomised range finder (Halko et al. 2011, algorithm 4.1) needs only products with it: some
random lights bounced forward, and as many adjoint series backward.
"""

import numpy as np

from prt_core.compress.linalg import orthonormal_columns
from prt_core.runtime.parallel import SplitMatrix, in_parallel
from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator
from prt_core.transport.bounce import all_bounces
from prt_core.transport.sent import Sent, of_channels

_BLOCK = 512


def indirect_factors(transport, channels, rank, seed=0):
    """Factors of K T, what points receive from other points; a generator of `Progress`.

    Parameters
    ----------
    transport : Transport
        With a gather operator and at least one bounce.
    channels : sequence of int
        Of the albedo.
    rank, seed : int

    Returns
    -------
    left : list of (n_points, k) float32
        For each channel; orthonormal columns, k <= rank of them.
    right : list of (k, n_directions) float32
        `left @ right` is the best of K T within the range that `rank` random lights span.
    """
    rank = min(rank, transport.n_points, transport.n_directions)
    rng = generator(seed, Stage.INDIRECT)
    lights = rng.standard_normal((transport.n_directions, rank), np.float32)
    # Light goes back and forth between few points where most are pixels, which only receive.
    arriving = transport.gather.T.tocsr()
    senders = np.flatnonzero(np.diff(arriving.indptr))
    if isinstance(transport.bounces_by, Sent):
        behind = transport.opposite[senders]
        senders = np.union1d(senders, behind[behind >= 0])
    arriving = arriving[senders]
    leaving = arriving.T.tocsr()
    between, back = SplitMatrix(leaving[senders]), SplitMatrix(arriving[:, senders])
    arriving, leaving = SplitMatrix(arriving), SplitMatrix(leaving)
    received = yield from _direct_times(transport, senders, lights)
    before = None if transport.bounces is None else transport.bounces - 1
    left, weights = [], []
    for channel in channels:
        albedo = of_channels(transport.bounces_by[senders], [channel])
        send_back = albedo.adjoint if isinstance(albedo, Sent) else albedo.__mul__
        sent, n_bounces = all_bounces(between, albedo, received, transport.tolerance, before)
        left.append(orthonormal_columns(leaving @ sent))
        yield Progress("indirect", transport.n_points, transport.n_points)
        # left^T K (1 + A K + ...) A D, from the left: w <- K^T left, then w <- K^T (A w).
        term = arriving @ left[-1]
        total = term.copy()
        for _ in range(n_bounces):
            term = back @ send_back(term)
            total += term
        weights.append(send_back(total))
        yield Progress("indirect", transport.n_points, transport.n_points)
    right = yield from _times_direct(transport, senders, np.hstack(weights))
    return left, np.split(right, np.cumsum([part.shape[1] for part in left])[:-1])


def _direct_times(transport, points, lights):
    """D @ lights of some points, (len(points), m) float32."""
    result = np.empty((len(points), lights.shape[1]), np.float32)

    def one(part):
        result[part] = transport.direct(points[part]) @ lights

    for done, _ in _each(len(points), one):
        yield Progress("indirect", done, len(points))
    return result


def _times_direct(transport, points, weights):
    """weights^T @ D of some points, (m, n_directions) float32, summed in float64."""
    total = np.zeros((weights.shape[1], transport.n_directions))

    def one(part):
        return weights[part].T @ transport.direct(points[part])

    for done, result in _each(len(points), one):
        total += result
        yield Progress("indirect", done, len(points))
    return total.astype(np.float32)


def _each(count, function):
    """(how many are done, result) of `function` for consecutive slices, in order."""
    parts = [slice(first, min(first + _BLOCK, count)) for first in range(0, count, _BLOCK)]
    for part, result in zip(parts, in_parallel(function, parts), strict=True):
        yield part.stop, result
