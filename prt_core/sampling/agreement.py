"""Sampling by agreement: a direction is traced only where known neighbours disagree about it.

Points become known in levels, each denser than the one before. What all neighbours of a new point
say of a direction is taken over; where they disagree, or none can say, a ray decides. That alone
misses what no neighbour has seen and silhouettes that move out of the neighbours' range. So some
rays are cast where the neighbours agree: a few at random over the hemisphere; in an enclosed place,
where those hardly ever meet light, one in what the neighbours call light; and a share of those next
to a boundary between light and dark that has just been found. Where one of them contradicts the
neighbours, the texels around it are traced, and around those that contradict as well, until what
was missed is surrounded; and all boundaries of that point are checked.
"""

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
from prt_core.sampling.agreement_state import AgreementState
from prt_core.sampling.neighbours import surface_levels
from prt_core.sampling.sampled import expect_sampled, register_sampler

# What random numbers of asking again depend on, beside the number of the turn.
_REFINE, _LOOK, _DETAILS = 1000, 2000, 3000
# Groups are judged after levels that leave this share of the points known: fewer say little, and
# later there is little left to save.
_JUDGED = 0.04, 0.5
# What is left of a point that was known before and is traced rather than asked: a share of what is
# above its horizon.
_LITTLE = 1 / 8
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
        Rays of each point at random, where its neighbours agree; of enclosed points one more, in
        what these call light.
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


def sample_agreement(scene, cube_map, caster, settings=None, tally=None, pace=None, known=None):
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
    known : Known, optional
        What was known before: it is believed as if rays had told it.

    Returns
    -------
    Sampled
        `attributes`: levels (points of each), open_points, open_entries, hemisphere_entries, and
        the entries traced by reason: first, disagree, check, follow, rest; given_up (points that
        were traced whole because neighbours know nothing of them).
    """
    settings = AgreementSettings() if settings is None else settings
    expect_kind("settings", settings, AgreementSettings)
    begun = None if known is None else known.begun(scene, cube_map)
    work = AgreementState(scene, cube_map, caster, tally, pace, settings.seed, begun)
    yield from work.begin(None if known is None else known.above)
    settled = work.open
    if known is not None:
        # Of points of which little is left to trace that is cheaper than to ask.
        left = work.left_to_trace()
        yield from work.trace_whole("rest", np.flatnonzero((left <= _LITTLE) & (left > 0)))
        settled = work.open | (left <= _LITTLE)
    rng = generator(settings.seed, Stage.AGREEMENT)
    # Details stand where little agrees: they come last, when all around them is known.
    is_detail = np.zeros(len(scene.points), bool)
    is_detail[scene.details.point] = True
    closed = np.flatnonzero(~settled & ~is_detail)
    first = max(64, -(-len(closed) // settings.first))
    levels = surface_levels(scene.points, work.groups, first, settings.growth, rng)
    levels = [level[~(settled | is_detail)[level]] for level in levels]
    if known is not None:
        levels = [level for level in levels if len(level)]
    told = np.flatnonzero(settled if known is None else settled & work.beside(~settled))
    n_open = len(told)
    reached = int(settled.sum()) + np.cumsum([len(level) for level in levels])
    for index, level in enumerate(levels):
        level = level[~work.given_up[level]]
        share = reached[index] / max(len(scene.points) - len(scene.details), 1)
        halvings = max(0, round(settings.edge_halvings + np.log2(share)))
        if index == 0:
            yield from work.trace_whole("first", level)
        else:
            yield from work.ask(level, told, settings, halvings, (index,))
        told = np.concatenate([told, level])
        yield work.level_done(told, n_open)
        if settings.most_wrong is not None and _JUDGED[0] <= share <= _JUDGED[1]:
            work.give_up(settings.most_wrong)
    ordered = work.in_order()
    whole = ordered[(work.given_up & ~work.open)[ordered]]
    yield from work.trace_whole("rest", whole)
    told = np.union1d(told, whole)
    details = ordered[(is_detail & ~settled & ~work.given_up)[ordered]]
    careful = replace(settings, **_FOR_DETAILS)
    for turn, level_points in enumerate(_interleaved(details)):
        yield from work.ask(level_points, told, careful, careful.edge_halvings, (_DETAILS + turn,))
        told = np.concatenate([told, level_points])
    most = settings.look_neighbours
    look = replace(settings, neighbours=most, candidates=most, checks=0)
    for turn in range(settings.looks):
        again = ordered[work.cheap(settings.look_share)[ordered]]
        yield from work.ask(again, ordered, look, None, (_LOOK + turn,), settings.look_reach)
    sampled = work.result([len(level) for level in levels])
    return sampled if known is None else known.ended(sampled)


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
    work = AgreementState(scene, cube_map, caster, tally, pace, settings.seed, sampled)
    points = expect_mask("points", points, len(scene.points))
    yield from work.begin()
    ordered = work.in_order()
    level = ordered[points[ordered] & ~work.open[ordered]]
    yield from work.ask(level, ordered, settings, settings.edge_halvings, (_REFINE + turn,))
    return work.result(sampled.attributes.get("levels", []))


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
    work = AgreementState(scene, cube_map, caster, tally, pace, 0, sampled)
    points = expect_mask("points", points, len(scene.points))
    yield from work.begin()
    # Open points as well: what is asked for whole is judged by rays alone.
    yield from work.trace_whole("rest", np.flatnonzero(points))
    return work.result(sampled.attributes.get("levels", []))


def _interleaved(ordered):
    """Points in an order along a curve in three levels, each among those before it."""
    return [part for part in (ordered[::4], ordered[2::4], ordered[1::2]) if len(part)]


register_sampler("agreement", sample_agreement, AgreementSettings)
