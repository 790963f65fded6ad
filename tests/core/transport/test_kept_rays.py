"""Bounce rays of another bake go on where nothing that they meet has changed."""

import numpy as np
import pytest

from prt_core.scene.boxes import Boxes
from prt_core.transport import ray_ends
from prt_core.transport.gather import REPRESENTED, ROUND
from prt_core.transport.kept_rays import KeptRays
from prt_core.transport.sharing import DARK, MISS

N_OLD = 9


class Stored(np.ndarray):
    chunks = (4, ROUND)


def stored(hits):
    return np.asarray(hits, np.int32).view(Stored)


def kept(hits, old_of, unsure=(), boxes=None, still=(), dark=None):
    n = len(old_of)
    flags = np.zeros((2, n), bool)
    flags[0, list(unsure)], flags[1, list(still)] = True, True
    return KeptRays(
        stored(hits), np.array(old_of), N_OLD, np.zeros((n, 2, 2), np.float32), flags[0],
        boxes or Boxes.none(), bool(boxes) if dark is None else dark, flags[1],
    )  # fmt: skip


def asked(rays, n, ways=None, turn=0, seed=1):
    starts = np.zeros((n, 3), np.float32)
    ways = np.tile(np.float32([0, 0, 1]), (n, ROUND, 1)) if ways is None else ways
    above = np.ones((n, ROUND), bool)
    return rays.rays(slice(0, n), turn, starts, ways, above, np.random.default_rng(seed))


def test_hits_are_those_of_the_points_as_they_are_now():
    hits = np.full((N_OLD, ROUND), MISS)
    hits[:, :4] = [0, 3, 8, DARK]
    rays = kept(hits, [8, -1, 0, 3])
    result, again, new = asked(rays, 4)
    assert new.tolist() == [False, True, False, False]
    assert again[1].all() and result[0, :5].tolist() == [2, 3, 0, DARK, MISS]
    assert not again[[0, 2, 3]].any()
    # A round that was not cast is new to all.
    assert asked(rays, 4, turn=1)[2].all()


def test_what_ended_in_the_dark_is_cast_again_where_backs_have_got_points():
    hits = np.full((N_OLD, ROUND), MISS)
    hits[:, :2] = [0, DARK]
    assert asked(kept(hits, [0, 1], dark=True), 2)[1][:, :2].tolist() == [[False, True]] * 2
    assert not asked(kept(hits, [0, 1], dark=False), 2)[1].any()


def test_rays_to_points_that_are_gone_or_unsure_are_cast_again():
    hits = np.full((N_OLD, ROUND), MISS)
    hits[:, :3] = [0, 3, 5]
    result, again, _ = asked(kept(hits, [0, 1, 3], unsure=[2]), 3)
    assert again[:, :4].tolist() == [[False, True, True, False]] * 3
    # A point that is left alone keeps what it has; only what is gone has to be found anew.
    again = asked(kept(hits, [0, 1, 3], unsure=[2], still=[1]), 3)[1]
    assert again[1, :4].tolist() == [False, False, True, False]


def test_what_made_a_place_dark_is_looked_at_where_something_changed():
    hits = np.full((N_OLD, ROUND), DARK)
    assert not asked(kept(hits, [0, 1]), 2)[1].any()
    far = Boxes(np.full((1, 3), 5.0), np.full((1, 3), 6.0))
    assert asked(kept(hits, [0, 1], boxes=far), 2)[1].all()


@pytest.mark.parametrize("leader_touched", [False, True])
def test_a_ray_stands_for_those_that_are_as_they_were(leader_touched):
    hits = np.full((N_OLD, ROUND), MISS)
    hits[:, 2:10] = REPRESENTED - 5
    hits[:, 5] = 7
    ways = np.tile(np.float32([0, 0, 1]), (1, ROUND, 1))
    above = Boxes(np.array([[0.5, -0.5, -0.5]]), np.array([[0.6, 0.5, 0.5]]))
    slots = [3, 5] if leader_touched else [3, 7]
    ways[0, slots] = 1, 0, 0
    chosen = set()
    for seed in range(40):
        result, again, _ = asked(kept(hits, [7], boxes=above), 1, ways, seed=seed)
        cast = set(np.flatnonzero(again[0]))
        assert set(slots) <= cast
        others = [s for s in range(2, 10) if s not in slots]
        if leader_touched:
            (leader,) = cast - set(slots)
            chosen.add(leader)
        else:
            leader = 5
            assert cast == set(slots)
        told = {s: result[0, s] for s in others if s != leader}
        assert set(told.values()) == {REPRESENTED - leader}
        result[again] = 0
        ray_ends(result)
    # Each of those that are left is as likely as any other.
    assert not leader_touched or chosen == {2, 4, 6, 7, 8, 9}
