"""Which points are sampled densely: exploration by local rank (Huang & Ramamoorthi 2010, sec. 4).

The first dense points are drawn evenly; then, in some iterations, more are drawn where transport is
complex: with probabilities in proportion to the rank of the local transport matrix, whose rows are
those of the dense points nearest by that are known so far.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from prt_core.runtime.progress import Progress
from prt_core.runtime.seeds import Stage, generator
from prt_core.sampling.adaptive_angle import AdaptiveRows, adaptive_steps
from prt_core.transport.visibility import unpack

_CHUNK = 2048


@dataclass
class DensePoints:
    """Dense points of a scene.

    Attributes
    ----------
    points : (n_dense,) int64
        Ascending.
    rows : AdaptiveRows
        Theirs.
    iteration : (n_dense,) int32
        In which of the iterations each was drawn.
    rank : (n_points,) int32
        Local rank of the transport around every point, after the last iteration.
    """

    points: np.ndarray
    rows: AdaptiveRows
    iteration: np.ndarray
    rank: np.ndarray


def dense_steps(scene, tracer, grid, settings, factor=None):
    """Explore a scene; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    tracer : Tracer
    grid : AngularGrid
    settings : HuangSettings
        dense_share, first_share, iterations, fewest_dense, radius, rank_neighbours,
        rank_threshold, seed.
    factor : callable, optional
        See `sample_huang`.

    Returns
    -------
    DensePoints
    """
    n_points = len(scene.points)
    rng = generator(settings.seed, Stage.DENSE_POINTS)
    objects = [
        np.flatnonzero(scene.points.object_index == index) for index in range(len(scene.objects))
    ]
    objects = [points for points in objects if len(points)]
    sketch = sketch_matrix(grid, settings.seed)
    chosen = np.zeros(0, np.int64)
    iteration, parts, sketches = np.zeros(0, np.int32), [], sketch[:0]
    rank = np.ones(n_points, np.int32)
    for turn in range(settings.iterations + 1):
        drawn = [_draw(points, chosen, rank, turn, settings, rng) for points in objects]
        drawn = np.sort(np.concatenate(drawn)) if drawn else chosen
        rows = yield from adaptive_steps(scene, tracer, drawn, grid)
        parts.append(rows)
        chosen = np.concatenate([chosen, drawn])
        iteration = np.concatenate([iteration, np.full(len(drawn), turn, np.int32)])
        sketches = np.concatenate(
            [sketches, sketched(scene, grid, drawn, rows.bits, sketch, factor)]
        )
        for points in objects:
            here = np.isin(chosen, points)
            of = scene.points.positions[chosen[here]], sketches[here]
            for first in range(0, len(points), _CHUNK):
                chunk = points[first : first + _CHUNK]
                rank[chunk] = local_rank(scene.points.positions[chunk], *of, settings)
                yield Progress("rank", first + len(chunk), len(points))
    order = np.argsort(chosen)
    rows = AdaptiveRows(
        *(
            np.concatenate([getattr(part, name) for part in parts])[order]
            for name in ("bits", "traced", "features")
        )
    )
    return DensePoints(chosen[order], rows, iteration[order], rank)


def _draw(points, chosen, rank, turn, settings, rng):
    """New dense points of one object: evenly at first, then by rank (Efraimidis & Spirakis)."""
    total = min(len(points), max(round(settings.dense_share * len(points)), settings.fewest_dense))
    first = min(total, max(round(settings.first_share * len(points)), settings.fewest_dense))
    turns = max(settings.iterations, 1)
    wanted = first + round((total - first) * turn / turns) if settings.iterations else total
    free = points[~np.isin(points, chosen)]
    count = wanted - (len(points) - len(free))
    if count <= 0:
        return free[:0]
    weight = np.ones(len(free)) if turn == 0 else np.maximum(rank[free], 1.0)
    weight **= settings.rank_power
    key = np.log(rng.random(len(free))) / weight
    return free[np.argpartition(key, -count)[-count:]]


def sketch_matrix(grid, seed, size=96):
    """(n_grid, size) float32: a random projection of rows that keeps the local ranks.

    A few rows span a small space, whose singular values a projection onto so many random signs
    keeps to some ten per cent (Johnson & Lindenstrauss 1984; Halko, Martinsson & Tropp 2011).
    """
    rng = generator(seed, Stage.RANK_SIGNS)
    signs = rng.integers(0, 2, (len(grid.grid), size)) * 2 - 1
    return (signs / np.sqrt(size)).astype(np.float32)


def sketched(scene, grid, points, bits, sketch, factor=None):
    """Projected transport rows of dense points, on the quarter grid; (n, size) float32."""
    cube_map = grid.cube_map
    vectors = cube_map.vectors[grid.grid].T.astype(np.float32)
    result = np.empty((len(points), sketch.shape[1]), np.float32)
    for first in range(0, len(points), _CHUNK):
        part = slice(first, first + _CHUNK)
        seen = unpack(bits[part], cube_map.n_directions, np.uint8)[:, grid.grid]
        if factor is None:
            weight = scene.points.normals[points[part]] @ vectors
        else:
            weight = factor(points[part], grid.grid)
        result[part] = (seen * weight) @ sketch
    return result


def local_rank(positions, dense_positions, sketches, settings):
    """Rank of the transport of the dense points around each position.

    The number of singular values above `rank_threshold` times the largest, of the rows of the
    `rank_neighbours` nearest dense points within `radius`.

    Parameters
    ----------
    positions : (n, 3) float
    dense_positions : (n_dense, 3) float
    sketches : (n_dense, size) float
    settings : HuangSettings

    Returns
    -------
    (n,) int32
        Where fewer than two dense points are within the radius nothing is known: then the number
        of neighbours, as if all were different.
    """
    k = min(settings.rank_neighbours, len(dense_positions))
    distance, index = cKDTree(dense_positions).query(
        positions, k=range(1, k + 1), distance_upper_bound=settings.radius
    )
    near = np.isfinite(distance)
    # Neighbourhoods repeat: points that have the same share one decomposition.
    sets, place = np.unique(np.sort(index, axis=1), axis=0, return_inverse=True)
    rows = np.concatenate([sketches, np.zeros_like(sketches[:1])])[sets]
    values = np.linalg.eigvalsh(rows @ rows.transpose(0, 2, 1))
    largest = np.maximum(values[:, -1:], 1e-30)
    rank = (values > settings.rank_threshold**2 * largest).sum(axis=1)[place.ravel()]
    return np.where(near.sum(axis=1) < 2, settings.rank_neighbours, rank).astype(np.int32)
