"""The gather operator K: what each point sees of the scene, by cosine-distributed rays.

Each round shoots ROUND rays from every point. A hit is handed to one of the bake points around
it, chosen with the probability of its barycentric weight, so `K[x, y]` is the share of x's rays
that ended at y: unbiased, and one non-zero a ray at most. Where the visibility says that rays
will meet nothing, one of them is cast for many: unbiased as well, for any of them may be the one.

How much of its sky is blocked a point knows from its visibility, far better than from some dozen
rays. So a row is scaled until its rays meet something as often as that: what is left to chance is
what they meet, not how many do.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from prt_core.errors import (
    expect,
    expect_array,
    expect_caster,
    expect_kind,
    expect_seed,
    expect_whole,
)
from prt_core.light import CubeMap
from prt_core.rays import Hits
from prt_core.scene import Scene
from prt_core.sobol import sobol_points
from prt_core.threads import on_all_cores

ROUND = 32
# Ends of rays that meet no light: none, or the back of a surface.
MISS, DARK = -1, -2
_SEED_STAGE = 1
# Rays of a point that are likely to meet nothing, of which one is cast.
_GROUP = 16
# Rays of a row that should meet something, at least, for the row to be scaled.
_ENOUGH = 2


@dataclass(frozen=True)
class Gathered:
    """Where the rays of some points ended.

    Attributes
    ----------
    hits : (n, ROUND) int32
        Bake points, sorted along each row; MISS where the ray left the scene, DARK where it met a
        side without light.
    n_back : (n_objects,) int64
        Hits on back sides that return no light, by object.
    n_rays : int
        That were cast.
    """

    hits: np.ndarray
    n_back: np.ndarray
    n_rays: int


def gather_hits(scene, caster, points, seed, round_index):
    """The bake points that one round of rays from some points ends at: `Gathered`.

    See `gather_parts`.
    """
    expect_kind("scene", scene, Scene)
    expect_caster(caster)
    expect_kind("points", points, slice)
    expect_whole("round_index", round_index, 0)
    return gather_parts(scene, caster, [(points, round_index)], expect_seed(seed))[0]


def gather_parts(scene, caster, parts, seed, spared=None, clear=None):
    """The bake points that rays of some blocks of points, in some rounds, end at.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    parts : sequence of (slice, int)
        Points and round; the random numbers depend on where the slice starts, on the round and
        the seed alone, so blocks are cut alike in every run.
    seed : int
    spared : (n_points,) bool, optional
        Points from which no ray can meet anything (see `open_points`): none is cast.
    clear : callable(slice, (n, ROUND, 3) float32) -> (n, ROUND) bool, optional
        Rays that are likely to meet nothing: one of each `_GROUP` of a point, chosen at random,
        is cast, and stands for the others.

    Returns
    -------
    list of Gathered
    """

    def prepare(part):
        return _Rays(scene, *part, seed, spared, clear)

    def cast(rays):
        return caster.intersect(rays.origins, rays.directions)

    rays = on_all_cores(prepare, parts)
    found = on_all_cores(cast, rays) if caster.threads > 1 else _cast_together(caster, rays)
    return on_all_cores(lambda pair: pair[0].ends(pair[1]), zip(rays, found, strict=True))


def _cast_together(caster, rays):
    """Hits of each part, from calls as large as the caster likes them, of rays that look alike."""
    origins, directions = (
        np.concatenate([getattr(r, name) for r in rays]) for name in ("origins", "directions")
    )
    order = np.argsort(CubeMap(4).texel_along(*directions.T), kind="stable")
    origins, directions = origins[order], directions[order]
    batches = [
        slice(first, first + caster.batch) for first in range(0, max(len(order), 1), caster.batch)
    ]
    found = Hits.joined([caster.intersect(origins[part], directions[part]) for part in batches])
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    ends = np.cumsum([len(r.origins) for r in rays])
    return [found[part] for part in np.split(place, ends[:-1])]


class _Rays:
    """The rays of a block of points in one round."""

    def __init__(self, scene, points, round_index, seed, spared, clear):
        self._scene = scene
        starts = scene.ray_origins[points]
        rng = np.random.default_rng([seed, _SEED_STAGE, round_index, points.start])
        shift = rng.random((len(starts), 2), np.float32)
        directions = cosine_directions(scene.points.normals[points], shift)
        geometric = scene.points.geometric_normals[points]
        # Below its own surface a point sees nothing.
        wanted = np.matmul(directions, geometric[:, :, None])[:, :, 0] > 0
        self._hits = np.where(wanted, np.int32(MISS), np.int32(DARK))
        if spared is not None:
            wanted &= ~spared[points, None]
        self._silent = self._speaker = np.empty(0, np.int64)
        if clear is not None:
            quiet = wanted & clear(points, directions)
            self._silent, self._speaker = _speakers(quiet, rng)
            wanted &= ~quiet
            wanted.reshape(-1)[self._speaker] = True
        self._wanted = wanted
        self._pick = rng.random(np.count_nonzero(wanted), np.float32)
        self.directions = directions[wanted]
        self.origins = np.repeat(starts, np.count_nonzero(wanted, axis=1), axis=0)

    def ends(self, found):
        """`Gathered` from their `Hits`."""
        hits = self._hits
        hits[self._wanted], n_back = _ends(self._scene, found, self.directions, self._pick)
        flat = hits.reshape(-1)
        flat[self._silent] = flat[self._speaker]
        hits.sort(axis=1)
        return Gathered(hits, n_back, len(self.directions))


def _speakers(quiet, rng):
    """Of each `_GROUP` set entries of a row one at random; which entry stands for which.

    Returns
    -------
    silent, speaker : (m,) int64
        Places in the flat array: all that are set, and the one that stands for each.
    """
    silent = np.flatnonzero(quiet)
    counts = np.count_nonzero(quiet, axis=1)
    start = np.cumsum(counts) - counts
    row = silent // quiet.shape[1]
    group = (np.arange(len(silent)) - start[row]) // _GROUP
    chance = rng.random((len(quiet), -(-quiet.shape[1] // _GROUP)))[row, group]
    first = _GROUP * group
    size = np.minimum(_GROUP, counts[row] - first)
    return silent, silent[start[row] + first + (chance * size).astype(np.int64)]


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


def _ends(scene, found, directions, pick):
    """Bake point of each hit, MISS or DARK, and the hits on unlit backs by object."""
    ends = np.full(len(directions), MISS, np.int32)
    hit = np.flatnonzero(found.triangle >= 0)
    triangle = found.triangle[hit]
    back = (directions[hit] * scene.triangle_normals[triangle]).sum(axis=1) > 0
    around, weights = scene.hit_points(triangle, found.barycentric[hit], back)
    cumulative = np.cumsum(weights[:, :2], axis=1)
    chosen = (pick[hit, None] >= cumulative).sum(axis=1)
    ends[hit] = np.take_along_axis(around, chosen[:, None], axis=1)[:, 0]
    unlit = back & (ends[hit] < 0)
    ends[hit[unlit]] = DARK
    n_back = np.bincount(
        scene.triangle_object[triangle[unlit]], minlength=len(scene.objects)
    ).astype(np.int64)
    return ends, n_back


def gather_operator(hits, n_points, blocked=None):
    """K from hits: (n, n_points) CSR float32, each row sums to the share of rays that hit.

    Parameters
    ----------
    hits : (n, n_rays) int32
        Of any number of rounds side by side; negative where no light was met.
    n_points : int
    blocked : (n,) float32, optional
        Share of the cosine-weighted hemisphere of each point in which something is in the way:
        rows are scaled until they meet as much (a ratio estimate, Cochran 1977). Those with so
        small a share that its rays are few are left as they are, unbiased.
    """
    n_points = expect_whole("n_points", n_points, 1, np.iinfo(np.int32).max)
    hits = expect_array("hits", hits, (None, None), np.int32, most=n_points - 1)
    expect(hits.size, "hits: expected at least one ray")
    n, n_rays = hits.shape
    if blocked is not None:
        blocked = expect_array("blocked", blocked, (n,), np.float32, 0, 1)
    hits = np.sort(hits, axis=1)
    first = np.ones(hits.shape, bool)
    first[:, 1:] = hits[:, 1:] != hits[:, :-1]
    start = np.flatnonzero(first)
    counts = np.diff(np.append(start, hits.size))
    columns = hits.ravel()[start]
    kept = columns >= 0
    row = start[kept] // n_rays
    pointer = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=n))]).astype(np.int64)
    data = (counts[kept] / n_rays).astype(np.float32)
    if blocked is not None:
        met = np.maximum(np.count_nonzero(hits != MISS, axis=1), 1) / n_rays
        data *= np.where(blocked * n_rays >= _ENOUGH, blocked / met, 1)[row].astype(np.float32)
    return sp.csr_matrix((data, columns[kept], pointer), shape=(n, n_points))
