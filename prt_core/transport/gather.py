"""Gather rays: what each point sees of the scene, by cosine-distributed rays.

Each round shoots ROUND rays from every point. A hit is handed to one of the bake points around
it, chosen with the probability of its barycentric weight among those that it sees (see
`transport.sharing`). Where the visibility says that rays will meet nothing, one of them is cast
for many: unbiased as well, for any of them may be the one. Hits keep the order of their rays, so
that each still has its direction (`gather_directions`), and any term of a reflectance can weigh
them (`transport.operator`). A ray of a point that several faces share leaves one of them, and what
it meets below that counts as dark (see `OwnFaces`).
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    expect_caster,
    expect_kind,
    expect_seed,
    expect_whole,
)
from prt_core.rays import Hits, cast_on_all_cores
from prt_core.runtime.seeds import Stage, generator
from prt_core.runtime.threads import on_all_cores
from prt_core.scene import Scene
from prt_core.sphere import sobol_points, square_to_cosine, tangent_frames
from prt_core.transport.sharing import DARK, MISS, Sharing

ROUND = 32
# A ray that was not cast: the one in slot s of its round represents it, where its hit is
# REPRESENTED - s. One of a round that its point did not need is NOT_CAST, and tells nothing.
NOT_CAST, REPRESENTED = -3, -4
# Rays of a point that are likely to meet nothing, of which one is cast.
_GROUP = 16
# Blocks of points and rounds whose rays are cast in one call.
_BUNDLE = 8


@dataclass(frozen=True)
class Gathered:
    """Where the rays of some points ended.

    Attributes
    ----------
    hits : (n, ROUND) int32
        Bake points, in the order of the rays; MISS where the ray left the scene, DARK where it
        met a side without light or lay below its face, REPRESENTED - s where the ray in slot s of
        the row stands for it, NOT_CAST in rows of points that were asked for none.
    n_back : (n_objects,) int64
        Hits on back sides that return no light, by object.
    n_hidden : int
        Hits on places that see none of their bake points.
    n_rays : int
        That were cast.
    n_short : int
        Rays that were cast from their hits, to see who may share them.
    """

    hits: np.ndarray
    n_back: np.ndarray
    n_hidden: int
    n_rays: int
    n_short: int


def gather_hits(scene, caster, points, seed, round_index):
    """The bake points that one round of rays from some points ends at: `Gathered`.

    See `gather_parts`.
    """
    expect_kind("scene", scene, Scene)
    expect_caster(caster)
    expect_kind("points", points, slice)
    expect_whole("round_index", round_index, 0)
    return gather_parts(scene, caster, [(points, round_index)], expect_seed(seed))[0]


def gather_directions(scene, points, seed, round_index, shifts=None):
    """Directions of one round of rays of a block of points, in the order of their hits.

    Parameters
    ----------
    scene : Scene
    points : slice or (n,) int
        As it was cut when the rays were cast.
    seed, round_index : int
    shifts : (n_points, 2, 2) float32, optional
        Of the two sequences of each point, where they are not those of its block: rays that were
        taken over from another bake keep their directions.

    Returns
    -------
    (n, ROUND, 3) float32
        Unit vectors, cosine-distributed about the shading normals.
    """
    # Every other round goes on in one of two Sobol sequences, each with a shift of its own: their
    # errors are independent, and fall faster than those of random rays.
    half, place = round_index % 2, round_index // 2
    normals = scene.points.normals[points]
    if shifts is None:
        shift = gather_shift(points, len(normals), seed, half)
    else:
        shift = shifts[points, half]
    return cosine_directions(normals, shift, ROUND, place * ROUND)


def gather_shift(points, count, seed, half):
    """(count, 2) float32: the shifts of one of the two sequences of a block of points."""
    rng = generator(seed, Stage.GATHER_SHIFT, half, first_of(points))
    return rng.random((count, 2), np.float32)


def gather_parts(
    scene, caster, parts, seed, spared=None, clear=None, sharing=None, kept=None, rounds_of=None
):  # fmt: skip
    """The bake points that rays of some blocks of points, in some rounds, end at.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    parts : sequence of (slice or (n,) int, int)
        Points and round; the random numbers depend on the first point, on the round and the seed
        alone, so blocks are cut alike in every run.
    seed : int
    spared : (n_points,) bool, optional
        Points from which no ray can meet anything (see `Scene.open_points`): none is cast.
    clear : callable(slice, (n, ROUND, 3) float32) -> (n, ROUND) bool, optional
        Rays that are likely to meet nothing: one of each `_GROUP` of a point, chosen at random,
        is cast, and stands for the others.
    sharing : Sharing, optional
        Of the scene, where it is used again and again.
    kept : KeptRays, optional
        Rays of these points that another bake has cast: those that are as they were are not cast.
    rounds_of : (n_points,) int, optional
        Points take part in rounds below this number; default: in all.

    Returns
    -------
    list of Gathered
    """
    sharing = sharing or Sharing(scene)

    def prepare(part):
        return _Rays(scene, *part, seed, spared, clear, kept, rounds_of)

    def cast(caster, bundle):
        return _together(caster, sharing, bundle)

    rays = on_all_cores(prepare, parts)
    # A caster that is called once for all likes its calls large.
    size = 1 if caster.threads > 1 else _BUNDLE
    bundles = [rays[first : first + size] for first in range(0, len(rays), size)]
    return sum(cast_on_all_cores(caster, cast, bundles), [])


def first_of(points):
    """The first of some points, on which their random numbers depend."""
    return points.start if isinstance(points, slice) else int(points[0])


def _together(caster, sharing, rays):
    """`Gathered` of each part, from calls as large as the caster likes them.

    In the order of the points: to sort rays by direction costs more than it saves.
    """
    origins, directions, pick = (
        np.concatenate([getattr(r, name) for r in rays])
        for name in ("origins", "directions", "pick")
    )
    batches = [
        slice(first, first + caster.batch) for first in range(0, max(len(pick), 1), caster.batch)
    ]
    hits = Hits.joined([caster.intersect(origins[part], directions[part]) for part in batches])
    ended = sharing.ends(caster, hits, directions, pick)
    ends = np.cumsum([len(r.pick) for r in rays])
    parts = [slice(end - len(r.pick), end) for r, end in zip(rays, ends, strict=True)]
    return [
        r.gathered(hits[part], *(values[part] for values in ended))
        for r, part in zip(rays, parts, strict=True)
    ]


class _Rays:
    """The rays of a block of points in one round."""

    def __init__(self, scene, points, round_index, seed, spared, clear, kept, rounds_of):
        self._scene = scene
        self._left_out = None if rounds_of is None else rounds_of[points] <= round_index
        starts = scene.ray_origins[points]
        shifts = None if kept is None else kept.shifts
        directions = gather_directions(scene, points, seed, round_index, shifts)
        rng = generator(seed, Stage.GATHER, round_index, first_of(points))
        geometric = scene.points.geometric_normals[points]
        # Below its own surface a point sees nothing.
        wanted = np.matmul(directions, geometric[:, :, None])[:, :, 0] > 0
        self._hits = np.where(wanted, np.int32(MISS), np.int32(DARK))
        new = np.ones(len(starts), bool)
        if kept is not None:
            before, again, new = kept.rays(points, round_index, starts, directions, wanted, rng)
            self._hits = np.where(again, self._hits, before)
            wanted &= again
        if spared is not None:
            wanted &= ~spared[points, None]
        if self._left_out is not None:
            wanted &= ~self._left_out[:, None]
        self._represented = self._representative = np.empty(0, np.int64)
        if clear is not None and new.any():
            quiet = wanted & clear(points, directions) & new[:, None]
            self._represented, self._representative = _representatives(quiet, rng)
            wanted &= ~quiet
            wanted.reshape(-1)[self._representative] = True
        self._wanted = wanted
        self.pick = rng.random(np.count_nonzero(wanted), np.float32)
        self._below = scene.own_faces.below(points, directions, rng) & wanted
        self.directions = directions[wanted]
        self.origins = np.repeat(starts, np.count_nonzero(wanted, axis=1), axis=0)

    def gathered(self, met, ends, unlit, hidden, short):
        """`Gathered` from their `Hits` and where these were handed."""
        hits = self._hits
        hits[self._wanted] = ends
        # Those that met nothing still do: what is in the way is what the visibility says.
        hits[self._below & (hits >= 0)] = DARK
        represented = self._represented != self._representative
        hits.reshape(-1)[self._represented[represented]] = (
            REPRESENTED - self._representative[represented] % ROUND
        )
        if self._left_out is not None:
            hits[self._left_out] = NOT_CAST
        n_back = np.bincount(
            self._scene.triangle_object[met.triangle[unlit]], minlength=len(self._scene.objects)
        )
        return Gathered(
            hits,
            n_back.astype(np.int64),
            int(np.count_nonzero(hidden)),
            len(self.directions),
            int(short.sum(dtype=np.int64)),
        )


def _representatives(quiet, rng):
    """Of each `_GROUP` set entries of a row one at random; which entry stands for which.

    Returns
    -------
    silent, representative : (m,) int64
        Places in the flat array: all that are set, and the one that stands for each.
    """
    represented = np.flatnonzero(quiet)
    counts = np.count_nonzero(quiet, axis=1)
    start = np.cumsum(counts) - counts
    row = represented // quiet.shape[1]
    group = (np.arange(len(represented)) - start[row]) // _GROUP
    chance = rng.random((len(quiet), -(-quiet.shape[1] // _GROUP)))[row, group]
    first = _GROUP * group
    size = np.minimum(_GROUP, counts[row] - first)
    return represented, represented[start[row] + first + (chance * size).astype(np.int64)]


def cosine_directions(normals, shift, count=ROUND, first=0):
    """Cosine-distributed directions about normals (Malley's method on a shifted Sobol sequence).

    Parameters
    ----------
    normals : (n, 3) float32
    shift : (n, 2) float32
        Random shift of each point's sequence.
    count, first : int
        Directions of each, and where in the sequence they begin.

    Returns
    -------
    (n, count, 3) float32
    """
    base = sobol_points(int(np.ceil(np.log2(first + count))))[first : first + count]
    uv = base.astype(np.float32)[None] + shift[:, None]
    # What is left of 1, of sums below 2: a third of the time of a remainder.
    uv -= uv >= 1
    frames = tangent_frames(normals).astype(np.float32)
    return np.matmul(square_to_cosine(uv), frames)
