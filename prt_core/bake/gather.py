"""K from the rays of a bake, for the diffuse term and for any other, block by block.

The rays of a bake take more memory than K does, so no more than a block of points is ever read.
"""

from contextlib import contextmanager

import numpy as np
import scipy.sparse as sp

from prt_core.bake.gather_file import GatherFile
from prt_core.bake.visibility import blocks
from prt_core.errors import expect, expect_array, expect_offers, shown
from prt_core.runtime.threads import on_all_cores
from prt_core.store import BakeStore, damage_as_error
from prt_core.transport import gather_directions, gather_operator, ray_ends
from prt_core.transport.gather import ROUND

# Of bounce rays that were taken over from another bake (see `gather_directions`).
SHIFTS = "gather_shift"
# Bytes of an entry of K, of which a ray makes one at most; joining its blocks takes twice as many.
_ENTRY = 16
# Blocks made together where K is written to a file.
_TOGETHER = 8


def read_gather(hits, rounds, blocked, memory=None, folder=None):
    """K from the stored hits of some rounds, block by block.

    Parameters
    ----------
    hits : array of (n_points, MOST_ROUNDS * ROUND) int32
    rounds : iterable of int
    blocked : (n_points,) float32
        See `gather_operator`.
    memory : Memory, optional
        Where it may not hold all of K it is kept in a file; default: it is in memory.
    folder : Path, optional
        Where that file is made (see `file_without_name`); needed where there is a `memory`.

    Returns
    -------
    (n_points, n_points) CSR float32, or GatherFile

    Raises
    ------
    PRTError
        A hit names a point that does not exist, or stands for a ray that was not cast.
    """
    rounds, n_points = list(rounds), len(blocked)

    def one(block):
        # Chunks of other rounds are not read.
        turns = [hits[block, turn * ROUND : (turn + 1) * ROUND] for turn in rounds]
        return gather_operator(np.concatenate(turns, axis=1), n_points, blocked[block])

    parts = blocks(n_points)
    if memory is None or memory.holds(_ENTRY * n_points * len(rounds) * ROUND):
        return _stacked(on_all_cores(one, parts))
    kept = GatherFile(folder, n_points)
    for first in range(0, len(parts), _TOGETHER):
        for rows in on_all_cores(one, parts[first : first + _TOGETHER]):
            kept.append(rows)
    return kept


def gather_terms(bake, weigh, blocked=None):
    """K of some terms of the reflectance, from the rays that a bake has cast.

    Parameters
    ----------
    bake : Bake
        As `load` gives it.
    weigh : callable(slice, (n, n_rays, 3) float32) -> (n_terms, n, n_rays) float
        Weights of the rays of a block of points in each term: its in-factor at their directions,
        divided by cosine / pi (see `gather_operator`). Called in several threads.
    blocked : (n_terms, n_points) float32, optional
        What each point would receive in each term if all that is in the way had radiance 1 (see
        `gather_operator`).

    Returns
    -------
    list of (n_points, n_points) CSR float32
        K of each term.

    Raises
    ------
    PRTError
        The bake has no rays, was changed meanwhile, or weights are of another shape, negative or
        not finite.
    """
    expect(callable(weigh), f"weigh: expected a function of a block and rays, got {shown(weigh)}")
    store, rounds = _rays_of(bake)
    scene, n_points, seed = bake.scene, len(bake.scene.points), bake.settings["seed"]
    shifts = read_shifts(store, n_points)
    if blocked is not None:
        blocked = expect_array("blocked", blocked, (None, n_points), np.float32, 0)

    def one(block):
        turns = [gather_directions(scene, block, seed, turn, shifts) for turn in range(rounds)]
        directions = np.concatenate(turns, axis=1)
        shape = None, *directions.shape[:2]
        weights = expect_array("weights", weigh(block, directions), shape)
        n_terms = len(weights) if blocked is None else len(blocked)
        expect(
            0 < len(weights) == n_terms,
            f"weights: expected those of {n_terms or 1} terms, got those of {len(weights)}",
        )
        with damage_as_error(store.path, "'gather'"):
            ends = ray_ends(hits[block])
            expect(ends.max() < n_points, "a ray ends at a point that does not exist")
        return [
            gather_operator(
                ends, n_points, None if blocked is None else blocked[term, block], batch
            )
            for term, batch in enumerate(weights)
        ]

    with stored_hits(store, n_points, rounds) as hits:
        parts = on_all_cores(one, blocks(n_points))
    return [_stacked(term) for term in zip(*parts, strict=True)]


@contextmanager
def stored_hits(store, n_points, rounds):
    """The array of the hits of a finished bake, (n_points, rounds * ROUND) int32, to be read whole.

    Raises
    ------
    PRTError
        It is not what the bake was finished with.
    """
    hits = store.array("gather")
    store.expect_shape(hits, (n_points, rounds * ROUND), "int32")
    hits.expect_whole()
    yield hits
    store.expect_sealed(hits)


def read_shifts(store, n_points):
    """Shifts of the bounce rays of a bake that has taken some from another; else None."""
    if SHIFTS not in (store.attributes.get("arrays") or {}):
        return None
    return store.read(SHIFTS, (n_points, 2, 2), "float32")


def _rays_of(bake):
    """The store of a bake that was loaded, and how many rounds of rays it has."""
    expect_offers("bake", bake, ("scene", "settings", "path"), "a Bake")
    expect(bake.path is not None, "bake: expected one that was loaded from its folder")
    store = BakeStore(bake.path)
    points = bake.scene.points
    same = [
        np.array_equal(store.read(f"point_{name}"), getattr(points, name))
        for name in ("positions", "normals")
    ]
    expect(
        all(same) and store.attributes["settings"] == bake.settings,
        f"{bake.path}: the bake was replaced since it was loaded; load it again",
    )
    rounds = store.attributes.get("rounds", 0)
    expect(
        rounds > 0,
        f"{bake.path}: has no bounce rays, for they were not asked for or are too weak to matter; "
        "bake without --bounces 0, or with a smaller --tolerance",
    )
    return store, rounds


def _stacked(parts):
    return sp.vstack(parts, format="csr") if len(parts) > 1 else parts[0]
