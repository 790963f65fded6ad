"""What sampling by agreement knows so far, and how a block of points is asked about."""

import time

import numpy as np

from prt_core.runtime.seeds import Stage, generator
from prt_core.sampling.groups import alike
from prt_core.sampling.neighbours import Neighbours, surface_levels
from prt_core.sampling.sampled import LevelDone, Sampled
from prt_core.sampling.tracer import Tracer, count_bits
from prt_core.sampling.votes import Asked, coin, on_rows
from prt_core.sphere import square_to_cosine, tangent_frames
from prt_core.transport.visibility import horizon_bits

# Points worked on together: their random numbers are drawn together too.
_BLOCK = 16384
# Steps of following what the neighbours had missed: nearly all ends within the first, by one
# texel each; the few large parts that are left are followed by more texels at once.
_MOST_STEPS, _NEAR_STEPS, _FAR = 12, 5, 3
# What random numbers of checks of what is called light depend on, beside those of the block.
_LIGHT = 1
# So many checks of a group have to be wrong before it is given up.
_FEWEST_WRONG = 12


class AgreementState:
    """What is known so far of the visibility, and the ways to know more.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    tally, pace
        See `sample_agreement`.
    seed : int
    sampled : Sampled, optional
        What is known to begin with; left as it is.

    Attributes
    ----------
    bits, traced : (n_points, n_bytes) uint8
    above : (n_points, n_bytes) uint8
        Entries above the horizon; set by `begin`.
    open : (n_points,) bool
        See `Scene.open_points`; set by `begin`.
    groups : (n_points,) int
        Of points that may be neighbours.
    given_up : (n_points,) bool
        Points whose neighbours know nothing of them.
    """

    def __init__(self, scene, cube_map, caster, tally, pace, seed, sampled=None):
        self._scene, self._cube_map, self._seed = scene, cube_map, seed
        self._tracer = Tracer(scene, cube_map, caster, tally, pace)
        self.groups = alike(scene)
        self._neighbours = Neighbours(scene.points, self.groups)
        # Of each group the checks where neighbours agreed: those that they got wrong, and those
        # that see light.
        self._checked = np.zeros((2, int(self.groups.max(initial=-1)) + 1), np.int64)
        self.given_up = np.zeros(len(scene.points), bool)
        self._seconds = dict(sampled.seconds) if sampled else {}
        self._counts = dict.fromkeys(("first", "disagree", "check", "follow", "rest"), 0)
        self._rays_before = self._given_up_before = 0
        self.bits = self.traced = None
        if sampled:
            self.bits, self.traced = sampled.bits.copy(), sampled.traced.copy()
            self._counts.update({k: sampled.attributes.get(k, 0) for k in self._counts})
            self._tracer.done = len(scene.points)
            self._rays_before = sampled.rays
            self._given_up_before = sampled.attributes.get("given_up", 0)

    def begin(self, above=None):
        """Horizons, where not known already, and points from which nothing can be in the way."""
        scene, n_points = self._scene, len(self._scene.points)
        start = time.perf_counter()
        self.above = above
        if above is None:
            self.above = np.empty((n_points, -(-self._cube_map.n_directions // 8)), np.uint8)
            for first in range(0, n_points, _BLOCK):
                part = slice(first, first + _BLOCK)
                self.above[part] = horizon_bits(scene, self._cube_map, part)
                yield self._tracer.progress()
        self.open = scene.open_points
        if self.bits is None:
            self.bits, self.traced = np.zeros((2, *self.above.shape), np.uint8)
        traced = self.traced[self.open]
        self.bits[self.open] = self.above[self.open] & ~traced | self.bits[self.open] & traced
        self._spent("horizon", start)

    def left_to_trace(self):
        """(n_points,) float: share of what is above each point's horizon that is not traced."""
        share = np.zeros(len(self.bits))
        for first in range(0, len(share), _BLOCK):
            part = slice(first, first + _BLOCK)
            left = count_bits(self.above[part] & ~self.traced[part], axis=1)
            share[part] = left / np.maximum(count_bits(self.above[part], axis=1), 1)
        return share

    def beside(self, points):
        """(n_points,) bool: those that may be neighbours of some of the points (bool)."""
        asked = np.zeros(int(self.groups.max(initial=-1)) + 1, bool)
        asked[self.groups[points]] = True
        return asked[self.groups]

    def in_order(self):
        """All points along a curve through each group."""
        n_points, rng = len(self.groups), generator(0, Stage.AGREEMENT)
        return surface_levels(self._scene.points, self.groups, n_points, 2.0, rng)[0]

    def cheap(self, share):
        """(n_points,) bool: points in groups of whose entries at most `share` were traced."""
        counts = np.bincount(self.groups, count_bits(self.traced, axis=1))
        entries = np.bincount(self.groups) * self._cube_map.n_directions
        return (counts <= share * entries)[self.groups] & ~self.open

    def give_up(self, most_wrong):
        """Mark groups of which the checks contradict too often what neighbours agree on."""
        wrong, lit = self._checked
        hopeless = (wrong > most_wrong * lit) & (wrong >= _FEWEST_WRONG)
        self.given_up |= hopeless[self.groups]
        # Denser levels are judged by themselves.
        self._checked[:] = 0

    def level_done(self, known, n_open):
        """`LevelDone` of the points that are known, of which the first `n_open` are open."""
        asked = known[n_open:]
        open_points = known[: n_open : max(1, n_open // max(len(asked), 1))]
        # One after the other, so that the first of both are the first of all.
        place = [np.arange(len(part)) / max(len(part), 1) for part in (asked, open_points)]
        points = np.concatenate([asked, open_points])
        points = points[np.argsort(np.concatenate(place), kind="stable")]
        now = self._tracer.progress()
        return LevelDone(now.stage, now.done, now.total, points, self.bits)

    def trace_whole(self, reason, points):
        """Trace all that is left in some points."""
        start, before = time.perf_counter(), self._tracer.rays
        for first in range(0, len(points), _BLOCK):
            block = points[first : first + _BLOCK]
            wanted = self.above[block] & ~self.traced[block]
            yield from self._tracer.trace_into(
                np.arange(len(self.bits)), block, wanted, self.bits, self.traced
            )
        self._counts[reason] += self._tracer.rays - before
        self._spent("rays", start)

    def ask(self, points, known, settings, halvings, key, reach=0):
        """One level: what the neighbours say, rays where they disagree, checks, and repair.

        One in 2^halvings of the boundary texels is checked; None: no one is. Dark entries are
        checked as far as `reach` texels from light.
        """
        start = time.perf_counter()
        around = self._neighbours.around(
            known, points, settings.neighbours, settings.candidates, len(known) == len(self.bits)
        )
        self._spent("neighbours", start)
        for index, first in enumerate(range(0, len(points), _BLOCK)):
            part = slice(first, first + _BLOCK)
            block = points[part], around[part]
            yield from self._ask_block(*block, settings, halvings, (*key, index), reach)
            self._tracer.done = len(known) + first
            yield self._tracer.progress()

    def _ask_block(self, points, around, settings, halvings, key, reach):
        n_points, rng = len(points), generator(self._seed, Stage.AGREEMENT, *key)
        checks = self._timed(self._random_entries, points, settings.checks, rng)
        draws = None
        if settings.checks:
            # Random numbers of their own: nothing else depends on who is enclosed.
            draws = generator(self._seed, Stage.AGREEMENT, *key, _LIGHT).random(n_points)
        asked = Asked(points, checks, self._cube_map.resolution, reach, draws)
        everyone = np.arange(n_points)
        self._timed(on_rows, asked.vote, n_points, around, self.above, self.traced, self.bits)
        # Few bytes of the rows hold checks.
        places = np.flatnonzero(checks != 0)
        checked = checks.reshape(-1)[places]
        n_checks = int(count_bits(checked))
        yield from self.trace("disagree", asked, everyone, asked.wanted)
        self._counts["disagree"] -= n_checks
        self._counts["check"] += n_checks
        seen, said = (of.reshape(-1)[places] for of in (asked.bits, asked.said))
        group = self.groups[points[places // checks.shape[1]]]
        for total, wrong in zip(self._checked, (seen ^ said, seen), strict=True):
            counts = count_bits((checked & wrong)[:, None], axis=1)
            total += np.bincount(group, counts, len(total)).astype(np.int64)
        self._timed(on_rows, asked.settle, n_points)
        yield from self.trace("disagree", asked, everyone, asked.contested)
        rows, fresh, reason, subset = everyone, None, "follow", None
        if halvings is not None:
            subset, reason = coin(rng, checks.shape, halvings), "check"
        for step in range(_MOST_STEPS):
            reach = 1 if step < _NEAR_STEPS else _FAR
            mask = np.empty((len(rows), checks.shape[1]), np.uint8)
            self._timed(
                on_rows, asked.follow, len(rows),
                rows, fresh, subset, reach, settings.boundaries, mask,
            )  # fmt: skip
            wrong = mask.any(axis=1)
            rows, fresh = rows[wrong], mask[wrong]
            if not len(rows):
                break
            yield from self.trace(reason, asked, rows, fresh)
            subset, reason = None, "follow"
        self.bits[points], self.traced[points] = asked.bits, asked.traced

    def trace(self, reason, asked, rows, mask):
        """Trace a mask of some rows into `asked`."""
        start, before = time.perf_counter(), self._tracer.rays
        yield from self._tracer.trace_into(asked.points, rows, mask, asked.bits, asked.traced)
        self._counts[reason] += self._tracer.rays - before
        self._spent("rays", start)

    def _random_entries(self, points, n_checks, rng):
        """Entries at random, weighted by cosine and solid angle (Malley's method)."""
        mask = np.zeros((len(points), self.above.shape[1]), np.uint8)
        if not n_checks:
            return mask
        local = square_to_cosine(np.moveaxis(rng.random((2, len(points), n_checks)), 0, -1))
        ways = np.matmul(local, tangent_frames(self._scene.points.normals[points]))
        texel = self._cube_map.texel_of(ways.reshape(-1, 3))
        row = np.repeat(np.arange(len(points)), n_checks)
        np.bitwise_or.at(mask, (row, texel >> 3), np.uint8(1) << (texel & 7).astype(np.uint8))
        return mask

    def _timed(self, function, *arguments):
        start = time.perf_counter()
        result = function(*arguments)
        self._spent("agreement", start)
        return result

    def _spent(self, stage, start):
        self._seconds[stage] = self._seconds.get(stage, 0.0) + time.perf_counter() - start

    def result(self, levels):
        """The `Sampled` so far; `levels` are the points of each."""
        rays = self._rays_before + self._tracer.rays
        attributes = {
            "levels": levels,
            "open_points": int(self.open.sum()),
            "open_entries": int(count_bits(self.above[self.open])),
            "hemisphere_entries": int(count_bits(self.above)),
            "given_up": self._given_up_before + int(self.given_up.sum()),
            **self._counts,
        }
        return Sampled(self.bits, self.traced, rays, self._seconds, attributes)
