"""The bit arithmetic of sampling by agreement: what neighbours say, and what to trace next.

All work on rows of packed bits, in place, for a block of rows that stays in the cache; `on_rows`
runs the blocks on all cores.
"""

import numpy as np

from prt_core.runtime.threads import on_all_cores
from prt_core.sampling.dilate import chequer, dilate
from prt_core.sampling.tracer import count_bits

# Rows a thread takes at once.
_ROWS = 256
# Points that see light at most at this share of what is above their horizon are enclosed: checks
# at random would hardly ever meet what their neighbours say is light.
_ENCLOSED = 1 / 8


def on_rows(function, n_rows, *arguments):
    """Call `function(part, *arguments)` for slices of all rows, on all cores."""
    parts = [slice(first, first + _ROWS) for first in range(0, n_rows, _ROWS)]
    on_all_cores(lambda part: function(part, *arguments), parts)


class Asked:
    """Some points that are asked about, and what is known of them; all (n, n_bytes) uint8.

    Parameters
    ----------
    points : (n,) int
    checks : (n, n_bytes) uint8
        Entries that are traced even where all neighbours agree.
    resolution : int
        Of the cube map.
    reach : int
        See `AgreementSettings.look_reach`.
    draws : (n,) float, optional
        At random in [0, 1): which of the entries that all neighbours of an enclosed point call
        light is checked as well.

    Attributes
    ----------
    above, traced, bits
        As those of all points; where nothing was traced `bits` is what the neighbours say.
    agreed, said
        Entries on which all neighbours agree that can say, and what the nearest of them says.
    contested
        Entries that the neighbours do not settle.
    wanted
        What to trace first: the contested entries on a chequerboard, and checks.
    """

    def __init__(self, points, checks, resolution, reach=0, draws=None):
        self.points, self.checks, self.draws = points, checks, draws
        self.resolution, self.reach = resolution, reach
        for name in ("above", "traced", "bits", "agreed", "said", "contested", "wanted"):
            setattr(self, name, np.empty_like(checks))

    def vote(self, part, around, above, traced, bits):
        """Ask the neighbours `around`; the other arrays are those of all points."""
        points = self.points[part]
        horizon, done = above[points], traced[points]
        lit, dark, said, decided = np.zeros((4, *horizon.shape), np.uint8)
        for neighbour in around[part].T:
            exists = (neighbour >= 0)[:, None].astype(np.uint8) * np.uint8(255)
            free = bits[neighbour] & exists
            blocked = above[neighbour] & exists & ~free
            said |= free & ~decided
            decided |= free | blocked
            lit |= free
            dark |= blocked
        agreed = horizon & (lit ^ dark)
        said &= horizon
        open_entries = horizon & ~agreed & ~done
        if self.reach:
            near = said
            for _ in range(self.reach):
                near = dilate(near, self.resolution)
            self.checks[part] |= near & ~said
        if self.draws is not None:
            light = said & agreed
            self.checks[part] |= _one_of_few(light, count_bits(horizon, axis=1), self.draws[part])
        self.checks[part] &= agreed & ~done
        every_other = open_entries & chequer(self.resolution)
        self.above[part], self.traced[part], self.agreed[part] = horizon, done, agreed
        self.said[part], self.bits[part] = said, said & ~done | bits[points] & done
        self.contested[part] = open_entries & ~every_other
        self.wanted[part] = every_other | self.checks[part]

    def settle(self, part):
        """Settle contested entries whose known neighbours on the cube map all say the same."""
        contested, bits = self.contested[part], self.bits[part]
        known = self.above[part] & ~contested
        lit = dilate(known & bits, self.resolution)
        dark = dilate(known & ~bits, self.resolution)
        between = contested & (lit ^ dark)
        self.agreed[part] |= between
        for said in (bits, self.said[part]):
            said &= ~between
            said |= between & lit
        contested &= ~between

    def follow(self, part, rows, fresh, coin, reach, boundaries, mask):
        """Entries to trace next: around what contradicts the neighbours, and beside boundaries.

        Parameters
        ----------
        part : slice
            Of the rows.
        rows : (m,) int
        fresh : (m, n_bytes) uint8
            What was traced last; None: everything.
        coin : (n, n_bytes) uint8
            Boundary texels that are checked; None where that is done.
        reach : int
            Texels traced around a contradiction.
        boundaries : bool
            Whether all those of the rows that contradict are checked.
        mask : (m, n_bytes) uint8
            The result.
        """
        block = rows[part]
        traced, bits, agreed = self.traced[block], self.bits[block], self.agreed[block]
        new = agreed & traced if fresh is None else fresh[part]
        surprise = new & (bits ^ self.said[block])
        wrong = surprise.any(axis=1)
        follow = np.zeros_like(surprise)
        if coin is not None or (boundaries and wrong.any()):
            edges = dilate(traced & ~bits, self.resolution) & bits
            edges |= dilate(traced & bits, self.resolution) & ~bits
            if coin is not None:
                follow |= edges & coin[block]
            if boundaries:
                follow[wrong] |= edges[wrong]
        if wrong.any():
            around = surprise[wrong]
            for _ in range(reach):
                around = dilate(around, self.resolution)
            follow[wrong] |= around
        mask[part] = follow & agreed & ~traced


def _one_of_few(light, most, draws):
    """One entry at random of each row of `light` (n, n_bytes) that has few of `most` (n,)."""
    chosen = np.zeros_like(light)
    rows = np.flatnonzero(light.any(axis=1))
    counts = count_bits(light[rows], axis=1)
    enclosed = counts <= _ENCLOSED * most[rows]
    rows, counts = rows[enclosed], counts[enclosed]
    if not len(rows):
        return chosen
    few, wanted = light[rows], (draws[rows] * counts).astype(np.int64)
    up_to = count_bits(few[..., None], axis=-1).cumsum(axis=1)
    place = (up_to <= wanted[:, None]).sum(axis=1)
    own = np.arange(len(rows)), place
    left = up_to[own] - wanted
    # The bits of the byte that are left, the last of them first.
    bits = np.unpackbits(few[own][:, None], axis=1).cumsum(axis=1)
    bit = 7 - (bits < left[:, None]).sum(axis=1)
    chosen[rows, place] = np.uint8(1) << bit.astype(np.uint8)
    return chosen


def coin(rng, shape, halvings):
    """Random bytes in which one bit in 2^halvings is set."""
    size = shape[0] * shape[1]
    words = np.full(-(-size // 8), np.uint64(2**64 - 1))
    for _ in range(halvings):
        words &= rng.integers(0, 2**64 - 1, len(words), np.uint64, endpoint=True)
    return words.view(np.uint8)[:size].reshape(shape)
