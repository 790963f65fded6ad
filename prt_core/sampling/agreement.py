"""Sampling by agreement: a direction is traced only where known neighbours disagree about it.

Points become known in levels, each denser than the one before. What all neighbours of a new point
say of a direction is taken over; where they disagree, or none can say, a ray decides. That alone
misses what no neighbour has seen and silhouettes that move out of the neighbours' range. So some
rays are cast where the neighbours agree: a few at random over the hemisphere, and a share of those
next to a boundary between light and dark that has just been found. Where one of them contradicts
the neighbours, the texels around it are traced, and around those that contradict as well, until
what was missed is surrounded; and all boundaries of that point are checked.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from prt_core.errors import (
    expect_flag,
    expect_kind,
    expect_mask,
    expect_number,
    expect_seed,
    expect_whole,
)
from prt_core.runtime.seeds import Stage, generator
from prt_core.sampling.groups import alike
from prt_core.sampling.neighbours import Neighbours, surface_levels
from prt_core.sampling.sampled import Sampled, expect_sampled, register_sampler
from prt_core.sampling.tracer import Tracer, count_bits
from prt_core.sampling.votes import Asked, coin, on_rows
from prt_core.sphere import square_to_cosine, tangent_frames
from prt_core.transport.visibility import horizon_bits

# Points worked on together: their random numbers are drawn together too.
_BLOCK = 16384
# Steps of following what the neighbours had missed: nearly all ends within the first, by one
# texel each; the few large parts that are left are followed by more texels at once.
_MOST_STEPS, _NEAR_STEPS, _FAR = 12, 5, 3
_REFINE, _LOOK, _DETAILS = 1000, 2000, 3000
# Groups are judged after levels that leave this share of the points known: fewer say little, and
# later there is little left to save. So many checks have to be wrong.
_JUDGED, _FEWEST_WRONG = (0.04, 0.5), 12
# How carefully details are asked about.
_FOR_DETAILS = {"neighbours": 3, "candidates": 8, "checks": 8, "edge_halvings": 3}


@dataclass(frozen=True)
class AgreementSettings:
    """How carefully to ask.

    Parameters
    ----------
    neighbours : int
        Known points that must agree.
    candidates : int
        Nearest known points of which the neighbours are chosen.
    checks : int
        Rays of each point at random, where its neighbours agree.
    edge_halvings : int
        One in 2^edge_halvings of the texels beside a boundary is checked, at the last level; the
        fewer points are known, the more depends on them, and the more are checked.
    first : int
        One point in `first` is traced whole, to begin with; at least 64 points.
    boundaries : bool
        Whether all boundaries of a point are checked as soon as it contradicts its neighbours.
    looks : int
        How many times points are asked again in the end.
    look_neighbours : int
        Neighbours that must agree then.
    look_reach : int
        Entries so many texels from light, or nearer, are traced then, though all neighbours call
        them dark: light through gaps smaller than the points' distance is there, and no neighbour
        knows of it.
    look_share : float
        Only objects of whose entries at most this share is traced by then: where more was needed
        points are far apart, and to look again costs much and finds little.
    growth : float
        Known points after a level, as a multiple of those before it.
    most_wrong : float or None
        Where the checks of the first levels contradict the neighbours more often than this share
        of how often they see light, neighbours know nothing of each other (the leaves of a tree):
        such groups are traced whole instead. None: never.
    seed : int
    """

    neighbours: int = 3
    candidates: int = 8
    checks: int = 2
    edge_halvings: int = 5
    first: int = 400
    boundaries: bool = False
    looks: int = 1
    look_neighbours: int = 8
    look_reach: int = 0
    look_share: float = 0.03
    growth: float = 1.5
    most_wrong: float | None = None
    seed: int = 0

    def __post_init__(self):
        expect_whole("neighbours", self.neighbours, 1)
        least = {"candidates": self.neighbours, "first": 1, "look_neighbours": 1}
        for name in ("neighbours", "candidates", "checks", "edge_halvings", "first", "looks",
                     "look_neighbours", "look_reach", "seed"):  # fmt: skip
            expect_whole(name, getattr(self, name), least.get(name, 0))
        expect_seed(self.seed)
        expect_flag("boundaries", self.boundaries)
        expect_number("growth", self.growth, above=1)
        expect_number("look_share", self.look_share, 0, 1)
        if self.most_wrong is not None:
            expect_number("most_wrong", self.most_wrong, above=0)


def sample_agreement(scene, cube_map, caster, settings=None, tally=None, pace=None):
    """Visibility of every point from a few per cent of its entries; yields `Progress`.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : AgreementSettings
    tally : callable(int), optional
        Told the number of rays of each batch.
    pace : Pace, optional
        In rays; the result is the same.

    Returns
    -------
    Sampled
        `facts`: levels (points of each), open_points, open_entries, hemisphere_entries, and the
        entries traced by reason: first, disagree, check, follow, rest; given_up (points that
        were traced whole because neighbours know nothing of them).
    """
    settings = AgreementSettings() if settings is None else settings
    expect_kind("settings", settings, AgreementSettings)
    work = _Work(scene, cube_map, caster, tally, pace, settings.seed)
    yield from work.begin()
    rng = generator(settings.seed, Stage.AGREEMENT)
    # Details stand where little agrees: they come last, when all around them is known.
    is_detail = np.zeros(len(scene.points), bool)
    is_detail[scene.details.point] = True
    closed = np.flatnonzero(~work.open & ~is_detail)
    first = max(64, -(-len(closed) // settings.first))
    levels = surface_levels(scene.points, work.groups, first, settings.growth, rng)
    levels = [level[~(work.open | is_detail)[level]] for level in levels]
    known = np.flatnonzero(work.open)
    reached = len(known) + np.cumsum([len(level) for level in levels])
    for index, level in enumerate(levels):
        level = level[~work.given_up[level]]
        share = reached[index] / max(len(scene.points) - len(scene.details), 1)
        halvings = max(0, round(settings.edge_halvings + np.log2(share)))
        if index == 0:
            yield from work.trace_whole("first", level)
        else:
            yield from work.ask(level, known, settings, halvings, (index,))
        known = np.concatenate([known, level])
        if settings.most_wrong is not None and _JUDGED[0] <= share <= _JUDGED[1]:
            work.give_up(settings.most_wrong)
    ordered = work.in_order()
    whole = ordered[(work.given_up & ~work.open)[ordered]]
    for begin in range(0, len(whole), _BLOCK):
        yield from work.trace_whole("rest", whole[begin : begin + _BLOCK])
    known = np.union1d(known, whole)
    details = ordered[(is_detail & ~work.open & ~work.given_up)[ordered]]
    careful = replace(settings, **_FOR_DETAILS)
    for turn, some in enumerate(_interleaved(details)):
        yield from work.ask(some, known, careful, careful.edge_halvings, (_DETAILS + turn,))
        known = np.concatenate([known, some])
    most = settings.look_neighbours
    look = replace(settings, neighbours=most, candidates=most, checks=0)
    for turn in range(settings.looks):
        again = ordered[work.cheap(settings.look_share)[ordered]]
        yield from work.ask(again, ordered, look, None, (_LOOK + turn,), settings.look_reach)
    return work.result([len(level) for level in levels])


def refine_agreement(
    scene, cube_map, caster, settings, sampled, points, turn, tally=None, pace=None
):
    """Ask again, now that every point has neighbours on all sides; yields `Progress`.

    Parameters
    ----------
    scene, cube_map, caster
        As those of `sample_agreement`.
    settings : AgreementSettings
        Those of this turn: more neighbours and checks than before find more.
    sampled : Sampled
        Of the same scene, by any sampler; left as it is.
    points : (n_points,) bool
        Those to ask again; all are asked.
    turn : int
        Counts the calls.
    tally, pace
        As those of `sample_agreement`.

    Returns
    -------
    Sampled
    """
    expect_kind("settings", settings, AgreementSettings)
    turn = expect_whole("turn", turn, 0)
    expect_sampled(sampled, scene, cube_map)
    work = _Work(scene, cube_map, caster, tally, pace, settings.seed, sampled)
    points = expect_mask("points", points, len(scene.points))
    yield from work.begin()
    ordered = work.in_order()
    level = ordered[points[ordered] & ~work.open[ordered]]
    yield from work.ask(level, ordered, settings, settings.edge_halvings, (_REFINE + turn,))
    return work.result(sampled.facts.get("levels", []))


def trace_rest(scene, cube_map, caster, sampled, points, tally=None, pace=None):
    """Trace whatever was not traced in some points; yields `Progress`.

    Parameters
    ----------
    scene, cube_map, caster
        As those of `sample_agreement`.
    sampled : Sampled
        Of the same scene, by any sampler; left as it is.
    points : (n_points,) bool
        Those to trace whole.
    tally, pace
        As those of `sample_agreement`.

    Returns
    -------
    Sampled
    """
    expect_sampled(sampled, scene, cube_map)
    work = _Work(scene, cube_map, caster, tally, pace, 0, sampled)
    points = expect_mask("points", points, len(scene.points))
    yield from work.begin()
    # Open points as well: what is asked for whole is judged by rays alone.
    wanted = np.flatnonzero(points)
    for first in range(0, len(wanted), _BLOCK):
        some = wanted[first : first + _BLOCK]
        yield from work.trace_whole("rest", some)
    return work.result(sampled.facts.get("levels", []))


def _interleaved(ordered):
    """Points in an order along a curve in three levels, each among those before it."""
    return [some for some in (ordered[::4], ordered[2::4], ordered[1::2]) if len(some)]


class _Work:
    """What is known so far, and the ways to know more."""

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
            self._counts.update({k: sampled.facts.get(k, 0) for k in self._counts})
            self._tracer.done = len(scene.points)
            self._rays_before = sampled.rays
            self._given_up_before = sampled.facts.get("given_up", 0)

    def begin(self):
        """Horizons, and the points from which nothing can be in the way."""
        scene, n_points = self._scene, len(self._scene.points)
        start = time.perf_counter()
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

    def trace_whole(self, reason, points):
        """Trace all that is left in some points."""
        start, before = time.perf_counter(), self._tracer.rays
        wanted = self.above[points] & ~self.traced[points]
        yield from self._tracer.trace_into(
            np.arange(len(self.bits)), points, wanted, self.bits, self.traced
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
            rng = generator(self._seed, Stage.AGREEMENT, *key, index)
            yield from self._ask_block(points[part], around[part], settings, halvings, rng, reach)
            self._tracer.done = len(known) + first
            yield self._tracer.progress()

    def _ask_block(self, points, around, settings, halvings, rng, reach):
        checks = self._timed(self._random_entries, points, settings.checks, rng)
        asked, n_points = Asked(points, checks, self._cube_map.resolution, reach), len(points)
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
        for total, found in zip(self._checked, (seen ^ said, seen), strict=True):
            counts = count_bits((checked & found)[:, None], axis=1)
            total += np.bincount(group, counts, len(total)).astype(np.int64)
        self._timed(on_rows, asked.settle, n_points)
        yield from self.trace("disagree", asked, everyone, asked.contested)
        rows, fresh, reason, some = everyone, None, "follow", None
        if halvings is not None:
            some, reason = coin(rng, checks.shape, halvings), "check"
        for step in range(_MOST_STEPS):
            reach = 1 if step < _NEAR_STEPS else _FAR
            mask = np.empty((len(rows), checks.shape[1]), np.uint8)
            self._timed(
                on_rows, asked.follow, len(rows),
                rows, fresh, some, reach, settings.boundaries, mask,
            )  # fmt: skip
            found = mask.any(axis=1)
            rows, fresh = rows[found], mask[found]
            if not len(rows):
                break
            yield from self.trace(reason, asked, rows, fresh)
            some, reason = None, "follow"
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
        rays = self._rays_before + self._tracer.rays
        facts = {
            "levels": levels,
            "open_points": int(self.open.sum()),
            "open_entries": int(count_bits(self.above[self.open])),
            "hemisphere_entries": int(count_bits(self.above)),
            "given_up": self._given_up_before + int(self.given_up.sum()),
            **self._counts,
        }
        return Sampled(self.bits, self.traced, rays, self._seconds, facts)


register_sampler("agreement", sample_agreement, AgreementSettings)
