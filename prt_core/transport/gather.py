"""The gather operator K: what each point sees of the scene, by cosine-distributed rays.

Each round shoots ROUND rays from every point. A hit is handed to one of the bake points around
it, chosen with the probability of its barycentric weight, so `K[x, y]` is the share of x's rays
that ended at y: unbiased, and one non-zero a ray at most.
"""

import numpy as np
import scipy.sparse as sp

from prt_core.progress import Pace, Progress, maybe_beside, run
from prt_core.sobol import sobol_points

ROUND = 64
MISS = -1
_SEED_STAGE = 1


def gather_hits(scene, caster, points, seed, round_index, tally=None):
    """The bake points that one round of rays from some points ends at, at once.

    As `gather_steps`, which it runs.
    """
    return run(gather_steps(scene, caster, points, seed, round_index, tally))


def gather_steps(scene, caster, points, seed, round_index, tally=None, pace=None, spared=None):
    """The bake points that one round of rays from some points ends at; yields `Progress`.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    points : slice
        One block; the random numbers depend on its start, so blocks are cut alike in every run.
    seed, round_index : int
    tally : callable(int), optional
        Told the number of rays.
    pace : Pace, optional
        In rays.
    spared : (n_points,) bool, optional
        Points from which no ray can meet anything (see `open_points`): none is cast.

    Returns
    -------
    hits : (n, ROUND) int32
        Sorted along each row; -1 where the ray left the scene or met a side without light.
    n_back : (n_objects,) int64
        Hits on back sides that return no light, by object.
    """
    pace = pace or Pace()
    origins = scene.ray_origins[points]
    n = len(origins)
    rng = np.random.default_rng([seed, _SEED_STAGE, round_index, points.start])
    directions = cosine_directions(scene.points.normals[points], rng.random((n, 2), np.float32))
    geometric = scene.points.geometric_normals[points]
    pick = rng.random(n * ROUND, np.float32)
    outside = np.matmul(directions, geometric[:, :, None])[:, :, 0] > 0
    if spared is not None:
        outside &= ~spared[points, None]
    ray_point, _ = np.nonzero(outside)
    directions = directions[outside]
    if tally is not None:
        tally(len(directions))
    hits = np.full((n, ROUND), MISS, np.int32)
    n_back = np.zeros(len(scene.objects), np.int64)
    ends = np.full(len(directions), MISS, np.int32)
    for first in range(0, len(directions), caster.batch):
        stop = min(first + caster.batch, len(directions))
        for part in pace.parts(first, stop):
            ends[part], back = yield from maybe_beside(
                pace.apart,
                "gather",
                _trace,
                scene,
                caster,
                origins.take(ray_point[part], axis=0),
                directions[part],
                pick[part],
            )
            n_back += back
            pace.worked()
            yield Progress("gather", points.start, len(scene.points))
    hits[outside] = ends
    hits.sort(axis=1)
    return hits, n_back


def cosine_directions(normals, shift):
    """Cosine-distributed directions about normals (Malley's method on a shifted Sobol set).

    Parameters
    ----------
    normals : (n, 3) float32
    shift : (n, 2) float32
        Random shift of each point's set.

    Returns
    -------
    (n, ROUND, 3) float32
    """
    base = sobol_points(int(np.log2(ROUND))) + 0.5 / ROUND
    uv = (base.astype(np.float32)[None] + shift[:, None]) % np.float32(1)
    radius = np.sqrt(uv[..., 0])
    angle = np.float32(2 * np.pi) * uv[..., 1]
    height = np.sqrt(np.maximum(0, 1 - uv[..., 0]))
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    return np.matmul(local, _frames(normals))


def _frames(normals):
    """(n, 3, 3) float32: rows are two tangents and the normal (Duff et al. 2017)."""
    x, y, z = normals.astype(np.float64).T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1 / (sign + z)
    b = x * y * a
    u = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    v = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.stack([u, v, np.stack([x, y, z], axis=1)], axis=1).astype(np.float32)


def _trace(scene, caster, origins, directions, pick):
    return _ends(scene, caster.intersect(origins, directions), directions, pick)


def _ends(scene, found, directions, pick):
    """Bake point of each hit (-1: none) and the hits on unlit backs by object."""
    ends = np.full(len(directions), MISS, np.int32)
    hit = np.flatnonzero(found.triangle >= 0)
    triangle = found.triangle[hit]
    back = (directions[hit] * scene.triangle_normals[triangle]).sum(axis=1) > 0
    around, weights = scene.hit_points(triangle, found.barycentric[hit], back)
    cumulative = np.cumsum(weights[:, :2], axis=1)
    chosen = (pick[hit, None] >= cumulative).sum(axis=1)
    ends[hit] = np.take_along_axis(around, chosen[:, None], axis=1)[:, 0]
    unlit = back & (ends[hit] < 0)
    n_back = np.bincount(
        scene.triangle_object[triangle[unlit]], minlength=len(scene.objects)
    ).astype(np.int64)
    return ends, n_back


def gather_operator(hits, n_points):
    """K from hits: (n, n_points) CSR float32, each row sums to the share of rays that hit.

    Parameters
    ----------
    hits : (n, n_rays) int32
        Of any number of rounds side by side; -1 is a miss.
    n_points : int
    """
    n, n_rays = hits.shape
    hits = np.sort(hits, axis=1)
    first = np.ones(hits.shape, bool)
    first[:, 1:] = hits[:, 1:] != hits[:, :-1]
    start = np.flatnonzero(first)
    counts = np.diff(np.append(start, hits.size))
    columns = hits.ravel()[start]
    kept = columns >= 0
    rows = np.bincount(start[kept] // n_rays, minlength=n)
    pointer = np.concatenate([[0], np.cumsum(rows)]).astype(np.int64)
    data = (counts[kept] / n_rays).astype(np.float32)
    return sp.csr_matrix((data, columns[kept], pointer), shape=(n, n_points))
