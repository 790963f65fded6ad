"""The rules of sampling by agreement, entry by entry in plain loops."""

import numpy as np
import pytest

from prt_core import run
from prt_core.sampling import AgreementSettings, sample_agreement
from prt_core.sampling.adaptive_angle import windows
from prt_core.sampling.dilate import chequer
from prt_core.sampling.neighbours import Neighbours, surface_levels
from prt_core.sampling.votes import Asked, coin
from prt_core.scene import Scene
from prt_core.sphere import CubeMap
from tests.meshes import caster_of, plane, sphere

RESOLUTION, N_POINTS = 4, 23
N_DIRECTIONS = 6 * RESOLUTION**2
AROUND = [[t for t in row if t >= 0] for row in windows(CubeMap(RESOLUTION), 3).tolist()]


def packed(values):
    return np.packbits(values, axis=-1, bitorder="little")


def spread(bits):
    return np.unpackbits(bits, axis=-1, bitorder="little").astype(bool)


def grown(mask, steps=1):
    """A mask and the texels around it."""
    for _ in range(steps):
        mask = np.array([any(mask[t] for t in around) for around in AROUND])
    return mask


class Case:
    """Random knowledge of some points, and neighbours that are asked about others."""

    def __init__(self, seed, reach=0):
        rng = np.random.default_rng(seed)
        # Patches, so that neighbours often agree.
        patches = np.repeat(rng.random((N_POINTS, N_DIRECTIONS // 4)) < 0.5, 4, axis=1)
        self.above = np.repeat(rng.random((N_POINTS, N_DIRECTIONS // 8)) < 0.7, 8, axis=1)
        self.bits = (patches ^ (rng.random(patches.shape) < 0.03)) & self.above
        self.traced = self.above & (rng.random(patches.shape) < 0.2)
        self.points = rng.permutation(N_POINTS)[:7]
        self.around = rng.integers(-1, N_POINTS, (7, 3))
        self.checks = rng.random((7, N_DIRECTIONS)) < 0.1
        self.asked = Asked(self.points, packed(self.checks), RESOLUTION, reach)

    def vote(self):
        self.asked.vote(
            slice(0, 7), self.around, *map(packed, (self.above, self.traced, self.bits))
        )


@pytest.mark.parametrize("reach", [0, 2])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_vote_takes_what_all_agree_on_and_asks_for_the_rest(seed, reach):
    case = Case(seed, reach)
    before = case.checks.copy()
    case.vote()
    board = spread(chequer(RESOLUTION))[:N_DIRECTIONS]
    names = "agreed said bits contested wanted checks above traced".split()
    result = {name: spread(getattr(case.asked, name)) for name in names}
    for row, point in enumerate(case.points):
        said = np.zeros(N_DIRECTIONS, bool)
        agreed = np.zeros(N_DIRECTIONS, bool)
        for d in range(N_DIRECTIONS):
            # Who has the direction below its horizon cannot say.
            voices = [case.bits[n, d] for n in case.around[row] if n >= 0 and case.above[n, d]]
            if case.above[point, d] and voices:
                said[d], agreed[d] = voices[0], len(set(voices)) == 1
        done, horizon = case.traced[point], case.above[point]
        open_entries = horizon & ~agreed & ~done
        checks = before[row] | (grown(said, reach) & ~said if reach else False)
        checks &= agreed & ~done
        np.testing.assert_array_equal(result["said"][row], said)
        np.testing.assert_array_equal(result["agreed"][row], agreed)
        np.testing.assert_array_equal(result["checks"][row], checks)
        np.testing.assert_array_equal(result["contested"][row], open_entries & ~board)
        np.testing.assert_array_equal(result["wanted"][row], open_entries & board | checks)
        np.testing.assert_array_equal(result["bits"][row], np.where(done, case.bits[point], said))
        np.testing.assert_array_equal(result["above"][row], horizon)
        np.testing.assert_array_equal(result["traced"][row], done)
    assert result["contested"].any() and result["checks"].any() and result["agreed"].any()


def test_one_entry_that_an_enclosed_point_is_said_to_see_is_checked():
    n, rng = 3000, np.random.default_rng(3)
    # Neighbours that see few entries, many, none; and few, which are known of the asked already.
    bits = np.zeros((8, N_DIRECTIONS), bool)
    few = rng.permutation(N_DIRECTIONS)[:7]
    bits[0, few] = bits[1, ::3] = bits[3, few] = True
    traced = bits.copy()
    traced[7, few[1:]] = True
    points, around = np.repeat([4, 5, 6, 7], n), np.repeat([0, 1, 2, 3], n)[:, None]
    checks = np.zeros((4 * n, N_DIRECTIONS // 8), np.uint8)
    asked = Asked(points, checks, RESOLUTION, 0, rng.random(4 * n))
    asked.vote(slice(0, 4 * n), around, packed(np.ones_like(bits)), packed(traced), packed(bits))
    enclosed, *others, known = np.split(spread(asked.checks), 4)
    assert (enclosed.sum(axis=1) == 1).all() and not np.any(others)
    counts = enclosed.sum(axis=0)
    assert counts[few].sum() == n and (abs(counts[few] - n / 7) < 5 * (n / 7) ** 0.5).all()
    # No ray is cast again.
    assert set(np.flatnonzero(known.any(axis=0))) == {few[0]}


@pytest.mark.parametrize("seed", [0, 1])
def test_contested_entries_are_settled_where_all_around_say_the_same(seed):
    case = Case(seed)
    case.vote()
    names = "agreed said bits contested above".split()
    before = {name: spread(getattr(case.asked, name)).copy() for name in names}
    case.asked.settle(slice(0, 7))
    after = {name: spread(getattr(case.asked, name)) for name in names}
    settled = 0
    for row in range(7):
        known = before["above"][row] & ~before["contested"][row]
        for d in np.flatnonzero(before["contested"][row]):
            voices = {bool(before["bits"][row][t]) for t in AROUND[d] if known[t]}
            if len(voices) == 1:
                settled += 1
                (value,) = voices
                assert after["bits"][row, d] == after["said"][row, d] == value
                assert after["agreed"][row, d] and not after["contested"][row, d]
                # What is checked later need not be asked of others.
                before["contested"][row, d] = False
                before["agreed"][row, d] = True
                before["bits"][row, d] = before["said"][row, d] = value
                known[d] = False
    for name in names:
        np.testing.assert_array_equal(after[name], before[name], err_msg=name)
    assert settled > 3


@pytest.mark.parametrize("boundaries", [False, True])
@pytest.mark.parametrize("reach", [1, 2])
def test_what_contradicts_is_followed(reach, boundaries):
    case = Case(2)
    case.vote()
    asked, rng = case.asked, np.random.default_rng(5)
    # Answers of rays: traced where agreed, with some surprises.
    agreed, said = spread(asked.agreed), spread(asked.said)
    traced = spread(asked.traced) | (agreed & (rng.random(agreed.shape) < 0.2))
    surprises = rng.random(said.shape) < np.array([0.5, 0, 0, 0.5, 0, 0, 0.5])[:, None]
    bits = np.where(traced, said ^ surprises, spread(asked.bits))
    asked.traced[:], asked.bits[:] = packed(traced), packed(bits)
    rows = np.array([0, 2, 3, 4, 6])
    fresh = agreed & traced & (rng.random(said.shape) < 0.7)
    tossed = rng.random(said.shape) < 0.3
    for which, toss in ((None, None), (fresh[rows], None), (None, tossed), (fresh[rows], tossed)):
        mask = np.empty((5, N_DIRECTIONS // 8), np.uint8)
        asked.follow(
            slice(0, 5), rows, None if which is None else packed(which),
            None if toss is None else packed(toss), reach, boundaries, mask,
        )  # fmt: skip
        surprised = 0
        for place, row in enumerate(rows):
            new = agreed[row] & traced[row] if which is None else which[place]
            surprise = new & (bits[row] ^ said[row])
            light, dark = grown(traced[row] & bits[row]), grown(traced[row] & ~bits[row])
            edges = (dark & bits[row]) | (light & ~bits[row])
            wanted = np.zeros(N_DIRECTIONS, bool)
            if toss is not None:
                wanted |= edges & toss[row]
            if surprise.any():
                wanted |= grown(surprise, reach)
                surprised += 1
                if boundaries:
                    wanted |= edges
            np.testing.assert_array_equal(spread(mask)[place], wanted & agreed[row] & ~traced[row])
        assert 0 < surprised < 5


@pytest.mark.parametrize("halvings", [0, 1, 3, 5])
def test_a_coin_falls_once_in_so_many_times(halvings):
    bits = spread(coin(np.random.default_rng(0), (37, 1001), halvings))
    share = 2.0**-halvings
    assert bits.mean() == pytest.approx(share, abs=5 * np.sqrt(share * (1 - share) / bits.size))
    # Rows, and places of them, alike.
    for axis in (0, 1):
        spread_of = np.sqrt(share * (1 - share) / bits.shape[axis])
        assert np.abs(bits.mean(axis=axis) - share).max() <= 8 * spread_of


def test_neighbours_surround_a_point():
    scene = Scene.from_meshes([sphere(6, 0.3, (0, 0, 0.4)), plane(9)], max_hidden=0)
    points, rng = scene.points, np.random.default_rng(0)
    points.positions += 0.02 * rng.random(points.positions.shape, np.float32)
    # Normals of their own, as at creases.
    points.normals += 0.8 * rng.random(points.normals.shape, np.float32)
    known = rng.permutation(len(points))[:90]
    wanted = np.concatenate([known[:10], np.setdiff1d(np.arange(len(points)), known)[:20]])
    features = np.hstack([points.positions, 0.05 * points.normals]).astype(np.float64)
    result = Neighbours(points, points.object_index).around(known, wanted, 4, 7, itself=True)
    for point, row in zip(wanted, result, strict=True):
        away = np.linalg.norm(features[known] - features[point], axis=1)
        mine = points.object_index[known] == points.object_index[point]
        order = [i for i in np.argsort(np.where(mine, away, np.inf))[:8]
                 if known[i] != point and mine[i]]  # fmt: skip
        chosen = []
        while len(chosen) < 4 and len(chosen) < len(order):
            costs = []
            for i in order:
                way = (features[known[i]] - features[point]) / away[i]
                sides = [
                    1 + way @ ((features[known[j]] - features[point]) / away[j]) for j in chosen
                ]
                costs.append(np.inf if i in chosen else away[i] * (1 + max([0, *sides])))
            chosen.append(order[int(np.argmin(costs))])
        assert row[row >= 0].tolist() == [int(known[i]) for i in chosen]
    assert (result >= 0).all(axis=1).mean() > 0.9


def test_levels_grow_as_they_should_and_take_one_of_each_stretch():
    scene = Scene.from_meshes([plane(40)], max_hidden=0)
    groups = scene.points.object_index
    levels = surface_levels(scene.points, groups, 50, 1.5, np.random.default_rng(1))
    known = 0
    for level in levels[:-1]:
        assert len(level) == (50 if not known else round(known * 0.5))
        known += len(level)
    assert known + len(levels[-1]) == 1600
    # One of each stretch of the curve: the squares of an even grid hold about as many each.
    places = scene.points.positions[levels[0], :2]
    squares = np.unique(np.floor((places + 0.5) * 3.999).astype(int), axis=0, return_counts=True)
    assert len(squares[1]) == 16 and squares[1].max() <= 6
    # At random in it, not its first.
    other = surface_levels(scene.points, groups, 50, 1.5, np.random.default_rng(2))
    assert (np.sort(levels[0]) != np.sort(other[0])).mean() > 0.5


def test_only_cheap_objects_are_looked_at_again():
    ball = sphere(9, 0.4, (0.1, 0, 0.5), name="ball")
    scene = Scene.from_meshes([ball, plane(33, -1.3, 1.3, name="floor")], max_hidden=0)
    index, cube_map = scene.points.object_index, CubeMap(8)

    def traced(**settings):
        settings = AgreementSettings(**settings)
        return run(sample_agreement(scene, cube_map, caster_of(scene), settings)).traced

    before = traced(looks=0)
    # Of all their entries, not of those above the horizon nor of the whole scene.
    shares = [spread(before[index == i]).mean() for i in (0, 1)]
    assert shares[1] > 1.3 * shares[0]
    for share, again in ((0.97 * shares[1], [True, False]), (1.0, [True, True])):
        after = traced(looks=1, look_share=share)
        result = [bool((after != before)[index == i].any()) for i in (0, 1)]
        assert result == again
