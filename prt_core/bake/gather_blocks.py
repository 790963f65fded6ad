"""Gather rays block by block: so many points and a round are one job, whoever does it and when."""

from functools import lru_cache

import numpy as np

from prt_core.bake import visibility
from prt_core.bake.visibility import blocks
from prt_core.runtime.cores import n_cores
from prt_core.runtime.threads import on_all_cores
from prt_core.sampling.dilate import dilate
from prt_core.transport import Sharing, gather_parts
from prt_core.transport.gather import ROUND

MOST_ROUNDS = 64
# Where rays ended, and what casting them came to.
GATHER, GATHER_RAYS = "gather", "gather_rays"
# Of each point below which number the rounds are in which it takes part.
ROUNDS_OF = "gather_rounds"
# Blocks worked on together for each core, where rays are cast by one thread.
_TOGETHER = 4
# Figures of a block and round, before those of objects: the rays, those cast from their hits, and
# hits on hidden places.
_COUNTS = 3


class GatherBlocks:
    """The gather rays of a bake under way.

    Parameters
    ----------
    hits : BakeArray
        (n_points, MOST_ROUNDS * ROUND) int32.
    counts : BakeArray
        (MOST_ROUNDS, n_blocks, 3 + n_objects) int64: of each block and round the rays, those cast
        from their hits, hits on hidden places, and on backs by object.
    store : BakeStore
        Its visibility is whole.
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    seed : int
    kept : KeptRays, optional
        Rays that another bake has cast.
    rounds_of : (n_points,) int16, optional
        See `ask`.

    Attributes
    ----------
    parts : list of slice
        The points of each block.
    group : int
        Blocks that are best computed together.
    edge_rays : int
        Rays that told where nobody has to ask which bake points a place sees.
    """

    def __init__(
        self, hits, counts, store, scene, cube_map, caster, seed, kept=None, rounds_of=None
    ):
        self.hits, self.parts = hits, blocks(len(scene.points))
        self._counts, self._store, self._scene = counts, store, scene
        self._caster, self._seed, self._kept = caster, seed, kept
        self._rounds_of = rounds_of
        self._clear = _Clear(store.array("visibility"), cube_map)
        self._sharing = Sharing(scene, caster)
        self.edge_rays = self._sharing.n_rays
        one_thread = _TOGETHER * n_cores()
        self.group = caster.threads if caster.threads > 1 else one_thread

    @classmethod
    def begun(cls, store, scene, cube_map, caster, seed, kept=None):
        """Those of a bake whose arrays are made, or taken as far as they are there."""
        arrays = _arrays(store, scene, MOST_ROUNDS)
        return cls(*arrays, store, scene, cube_map, caster, seed, kept)

    @classmethod
    def opened(cls, store, scene, cube_map, caster, seed):
        """Those of a bake that another process has begun."""
        arrays = store.array(GATHER), store.array(GATHER_RAYS)
        rounds_of = store.read(ROUNDS_OF, (len(scene.points),), "int16")
        return cls(*arrays, store, scene, cube_map, caster, seed, rounds_of=rounds_of)

    def ask(self, rounds_of, turns):
        """Say how many rounds of rays each point takes part in, before some rounds are cast.

        Points that take part in a round do so in all before it, so what was said for earlier
        rounds stays true, and is not said again where those are there already.

        Parameters
        ----------
        rounds_of : (n_points,) int16
        turns : range
        """
        self._rounds_of = rounds_of.copy()
        if not all(self.has(index, turns) for index in range(len(self.parts))):
            self._store.keep(ROUNDS_OF, self._rounds_of)

    def is_done(self, index, turn):
        """Whether the rays of a block in a round are there."""
        return holds_rays(self.hits, self._counts, index, [turn])

    def has(self, index, turns):
        """Whether the rays of a block in some rounds are there."""
        return holds_rays(self.hits, self._counts, index, turns)

    def compute(self, todo):
        """Cast the rays of (block, round) pairs; returns how many rays these were."""
        jobs = [(self.parts[index], turn) for index, turn in todo]
        spared = self._scene.open_points
        gathered = gather_parts(
            self._scene, self._caster, jobs, self._seed, spared, self._clear, self._sharing,
            self._kept, self._rounds_of,
        )  # fmt: skip
        rounds = {}
        for (index, turn), one in zip(todo, gathered, strict=True):
            rounds.setdefault(index, []).append((turn, one))
        on_all_cores(self._write, rounds.items())
        return sum(one.n_rays + one.n_short for one in gathered)

    def _write(self, block):
        """Rounds of a block that follow each other at once: a call takes as long as a chunk."""
        index, rounds = block
        turns = np.array([turn for turn, _ in rounds])
        for run in np.split(np.arange(len(turns)), np.flatnonzero(np.diff(turns) != 1) + 1):
            first, stop = turns[run[0]], turns[run[-1]] + 1
            some = [rounds[number][1] for number in run]
            counts = [[[o.n_rays, o.n_short, o.n_hidden, *o.n_back]] for o in some]
            self._counts[first:stop, index : index + 1] = np.array(counts)
            hits = np.concatenate([one.hits for one in some], axis=1)
            self.hits[self.parts[index], first * ROUND : stop * ROUND] = hits

    def cut(self, rounds):
        """Take away what is left of rounds that were not needed; returns the counts."""
        return _arrays(self._store, self._scene, rounds)[1]


def holds_rays(hits, counts, index, turns):
    """Whether the arrays of `GatherBlocks` hold the rays of a block in some rounds."""
    first = index * visibility.BLOCK
    part = slice(first, min(first + visibility.BLOCK, hits.shape[0]))
    return all(
        hits.holds(part, slice(turn * ROUND, (turn + 1) * ROUND)) and counts.holds(turn, index)
        for turn in turns
    )


def _arrays(store, scene, rounds):
    shape, chunks = (len(scene.points), rounds * ROUND), (visibility.BLOCK, ROUND)
    table = rounds, len(blocks(len(scene.points))), _COUNTS + len(scene.objects)
    return (
        store.create(GATHER, shape, "int32", chunks),
        store.create(GATHER_RAYS, table, "int64", (1, 1, table[2])),
    )


class _Clear:
    """Rays of points that the visibility says will meet nothing, nor any beside them.

    Parameters
    ----------
    bits : array of (n_points, n_bytes) uint8
    cube_map : CubeMap
    """

    def __init__(self, bits, cube_map):
        self._bits, self._cube_map = bits, cube_map
        # Of the blocks that are at work: all their rounds ask.
        self._near = lru_cache(2 * _TOGETHER * n_cores())(self._blocked_nearby)

    def _blocked_nearby(self, start, stop):
        return dilate(~self._bits[start:stop], self._cube_map.resolution)

    def __call__(self, points, directions):
        near = self._near(points.start, points.stop)
        texel = self._cube_map.texel_along(*np.moveaxis(directions, -1, 0))
        byte = (texel >> 3) + near.shape[1] * np.arange(len(near))[:, None]
        return near.take(byte) >> (texel & 7).astype(np.uint8) & 1 == 0
