"""Bounce rays that another bake of a scene has cast: which of them are as they were.

A ray is cast again where it may meet a place that has changed, where it ended at a point that is
there no more, or where it was handed to one by its neighbourhood (see `transport.sharing`) and that
neighbourhood has changed. A ray that is cast again no longer belongs to those that one of them
stands for: the one is a random one of the others still. Where it was the one, another of them is
chosen.
"""

from functools import lru_cache

import numpy as np

from prt_core.transport.gather import REPRESENTED, ROUND
from prt_core.transport.sharing import DARK

# Chunks of hits that are kept when they were read: 256 kB each.
_CHUNKS = 64


class KeptRays:
    """Rays of a bake that go on as rays of another.

    Parameters
    ----------
    hits : array of (n_old, n_rays) int32
        Of the other bake (see `Gathered`).
    old_of : (n_points,) int64
        What each point was there; -1 where it was not.
    n_old : int
    shifts : (n_points, 2, 2) float32
        Of the two sequences of each point: those with which its rays were cast.
    unsure : (n_points,) bool
        Points whose neighbourhood has changed.
    changed : Boxes
        Around all that has changed, where it was and where it is.
    dark : bool
        Whether rays that ended in the dark may end elsewhere now.
    still : (n_points,) bool
        Points whose rays go on as if nothing had.
    rounds_of_old : (n_old,) int, optional
        Rounds of each point of the other bake; default: all that there are.

    Attributes
    ----------
    rounds_of : (n_points,) int
        Rounds of which the rays of each point are known.
    """

    def __init__(
        self, hits, old_of, n_old, shifts, unsure, changed, dark, still, rounds_of_old=None
    ):
        self._hits, self._old_of, self.shifts = hits, old_of, shifts
        self._unsure, self._changed, self._dark, self._still = unsure, changed, dark, still
        rounds = np.full(n_old, hits.shape[1] // ROUND)
        rounds = rounds if rounds_of_old is None else np.minimum(rounds_of_old, rounds)
        self.rounds_of = np.where(old_of >= 0, rounds[old_of], 0)
        # Blocks that follow each other have points of the same chunks.
        self._chunk = lru_cache(_CHUNKS)(self._read)
        # One more, for what is no point.
        self._new_of = np.full(n_old + 1, -1, np.int32)
        known = np.flatnonzero(old_of >= 0)
        self._new_of[old_of[known]] = known

    def rays(self, points, round_index, starts, directions, above, rng):
        """What is known of one round of rays of a block of points.

        Parameters
        ----------
        points : slice
        round_index : int
        starts : (n, 3) float
        directions : (n, ROUND, 3) float32
        above : (n, ROUND) bool
            Whether they leave their own surface.
        rng : numpy.random.Generator

        Returns
        -------
        hits : (n, ROUND) int32
            Of the points as they are now.
        again : (n, ROUND) bool
            Rays to be cast.
        new : (n,) bool
            Points of which nothing is known.
        """
        old = self._old_of[points]
        known = np.flatnonzero(self.rounds_of[points] > round_index)
        new = np.ones(len(old), bool)
        new[known] = False
        hits = np.full((len(old), ROUND), DARK, np.int32)
        again = np.ones((len(old), ROUND), bool)
        if len(known):
            before = self._rows(old[known], round_index)
            kept = before < 0
            after = np.where(kept, before, self._new_of[np.where(kept, -1, before)])
            asked = ~self._still[points][known, None]
            touched = self._changed.rays(starts[known], directions[known]) & asked
            lost = (after >= 0) & self._unsure[np.maximum(after, 0)]
            # Nobody knows what made a place dark.
            lost |= (before == DARK) & above[known] & self._dark
            lost &= asked
            lost |= (after < 0) & ~kept
            hits[known], again[known] = _left_over(after, touched, lost, rng)
        return hits, again, new

    def _rows(self, rows, round_index):
        """Rows of the other bake in one round, in any order."""
        result = np.empty((len(rows), ROUND), np.int32)
        size = self._hits.chunks[0]
        chunk = rows // size
        for number in np.unique(chunk):
            mine = np.flatnonzero(chunk == number)
            result[mine] = self._chunk(int(number), round_index)[rows[mine] - number * size]
        return result

    def _read(self, number, round_index):
        size = self._hits.chunks[0]
        rows = slice(number * size, min((number + 1) * size, self._hits.shape[0]))
        return self._hits[rows, round_index * ROUND : (round_index + 1) * ROUND]


def _left_over(hits, touched, lost, rng):
    """Hits of rows of which some rays are cast again, and which are (bool).

    Those that are `touched` are cast for themselves alone; those that are `lost` stand for as many
    as before.
    """
    represented = hits <= REPRESENTED
    leader = np.where(represented, REPRESENTED - hits, np.arange(ROUND))
    again = touched | (lost & ~represented)
    # Rays that stay, of a ray that stood for them and does so no more: one of them does.
    orphans = represented & ~touched & np.take_along_axis(touched, leader, axis=1)
    row, slot = np.nonzero(orphans)
    if len(row):
        group = row * ROUND + leader[row, slot]
        order = np.lexsort((rng.random(len(row)), group))
        _, first, which = np.unique(group[order], return_index=True, return_inverse=True)
        chosen = slot[order[first]][which.reshape(-1)]
        hits[row[order], slot[order]] = REPRESENTED - chosen
        again[row[order[first]], slot[order[first]]] = True
    return hits, again
