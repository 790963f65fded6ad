"""How far a sampled bake is from the truth: unbiased estimates with 95 % intervals, by new rays.

Two questions, two designs, each for every object apart.

*The matrix.* Entries (point, direction) are drawn independently, each with a probability in
proportion to what it is worth, the square of its cosine integral; entries that were traced or lie
below the horizon are known and cost no ray. No shortcut of the sampling is believed, that of open
points neither. Of the draws, those
that are really lit and those that are wrong estimate the squared norm of the matrix and of the
error by their mere counts, so `error^2 = wrong / lit`. The draws are independent, so the count of
wrong ones is binomial however the errors cluster in points (see `binomial_interval`).

*Relit colours.* A point's error under a light is a sum over all its wrong entries. So the rows in
which a draw was wrong are traced whole. How likely a row was to be found so is then known, and its
squared error divided by that is an unbiased estimate of the sum over all rows (Horvitz and
Thompson 1952): rows that are far off are found almost surely, and what is sure adds nothing to the
width of the interval. As many draws again are weighted by the lights, which may be small and
bright (see `weighted_interval`).
"""

from dataclasses import asdict, dataclass, field

import numpy as np
from scipy.special import gammainc, gammaincc

from prt_core.errors import (
    expect_indices,
    expect_kind,
    expect_named,
    expect_seed,
    expect_whole,
)
from prt_core.light.environment import expect_radiance
from prt_core.runtime.seeds import Stage, generator
from prt_core.sampling.groups import Groups
from prt_core.sampling.intervals import binomial_interval, weighted_interval
from prt_core.sampling.sampled import expect_sampled
from prt_core.sampling.tracer import Tracer
from prt_core.sphere import CubeMap
from prt_core.transport.visibility import horizon_bits, received_light, unpack

# Proposals made at once; rows whose light is summed, to know how much there is.
_BATCH, _SIZE_ROWS = 1 << 18, 2048
# Draws of an object at least: fewer would often find nothing wrong where something is.
_FEWEST = 1 << 14
# Rows of an object traced whole, at least, if so many are found wrong: of sixteen, few decided, and
# the interval held the truth 80 times of 100.
_FEWEST_ROWS = 56
# No row is taken to be surer to be found: rates are those of Poisson draws, which ours nearly are.
_SUREST = 1 - 1e-4


@dataclass(frozen=True)
class Estimate:
    """A relative L2 error and the interval, `low` to `high`, that holds it 95 times of 100."""

    error: float
    low: float
    high: float


@dataclass(frozen=True)
class ObjectError:
    """The certificate of one object.

    Attributes
    ----------
    name : str
        Of the object, or of the first of several and how many more.
    matrix : Estimate
        Of the direct matrix, visibility times the cosine integrals.
    relit : dict of str -> Estimate
        Of the direct light received under each light.
    entries, wrong, lit, rows : int
        What was drawn for the matrix: entries, those that were wrong, those that are lit; and
        the rows traced whole.
    """

    name: str
    matrix: Estimate
    relit: dict = field(default_factory=dict)
    entries: int = 0
    wrong: int = 0
    lit: int = 0
    rows: int = 0

    @property
    def worst(self):
        """The largest relit error; that of the matrix where there is no light."""
        return max((e.error for e in self.relit.values()), default=self.matrix.error)

    def attributes(self):
        """The same as plain numbers and dicts, for a report."""
        return asdict(self)


@dataclass(frozen=True)
class CertificateSettings:
    """How many draws, for all objects together.

    Parameters
    ----------
    entries : int
        Independent entries, for the matrix and again for the relit error; not more than about an
        eighth of an object's, each time, but where it is small.
    rows : int
        Rows traced whole for the relit error, at most, but up to 56 of each object.
    seed : int
    """

    entries: int = 1 << 18
    rows: int = 512
    seed: int = 0

    def __post_init__(self):
        expect_whole("entries", self.entries, 1)
        expect_whole("rows", self.rows, 1)
        expect_seed(self.seed)


def certificate_steps(
    scene,
    cube_map,
    caster,
    sampled,
    lights,
    settings=None,
    turn=0,
    tally=None,
    pace=None,
    groups=None,
    wanted=None,
):
    """Certify a sampled visibility; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    sampled : Sampled
        Rows that are traced whole here are put right in it.
    lights : dict of str -> (n_directions, 3) float32
        For the relit error; may be empty.
    settings : CertificateSettings
    turn : int
        Another one draws other entries.
    tally, pace : see `sample_agreement`
    groups : Groups, optional
        Points that are certified together (see `certified_together`); default: objects.
    wanted : sequence of int, optional
        Groups to certify; default: all.

    Returns
    -------
    list of ObjectError
        One for each of them.
    """
    settings = CertificateSettings() if settings is None else settings
    expect_kind("settings", settings, CertificateSettings)
    tracer = Tracer(scene, cube_map, caster, tally, pace, "certificate")
    expect_sampled(sampled, scene, cube_map)
    turn = expect_whole("turn", turn, 0)
    lights = {
        name: expect_radiance(f"lights: {name}", light, cube_map)
        for name, light in expect_named("lights", lights, object, "lights").items()
    }
    tracer.done = len(scene.points)
    if groups is None:
        groups = Groups(scene.points.object_index, [item.name for item in scene.objects])
    index, names = expect_kind("groups", groups, Groups)
    present = np.unique(index)
    if wanted is not None:
        wanted = expect_indices("wanted", wanted, present.max() + 1)
    certified = []
    for number in present if wanted is None else wanted:
        rng = generator(settings.seed, Stage.CERTIFICATE, turn, number)
        points = np.flatnonzero(index == number)
        draws = _Draws(scene, cube_map, tracer, sampled, points, rng)
        size = len(points) * cube_map.n_directions
        n_entries = max(_FEWEST, min(settings.entries // len(present), size // 8))
        worth = (cube_map.vectors**2).sum(axis=1)
        counts = yield from draws.draw(worth, n_entries)
        matrix = matrix_estimate(**counts)
        relit, n_rows = {}, 0
        if not draws.rays and draws.all_known():
            matrix = Estimate(0.0, 0.0, 0.0)
            relit = dict.fromkeys(lights, matrix)
        elif lights:
            yield from draws.draw(worth * _brightness(worth, lights), n_entries)
            most = max(_FEWEST_ROWS, settings.rows // len(present))
            most = min(most, max(_FEWEST_ROWS // 2, len(points) // 8))
            relit, n_rows = yield from draws.relit(lights, most)
        certified.append(ObjectError(names[number], matrix, relit, rows=n_rows, **counts))
    sampled.rays += tracer.rays
    return certified


def matrix_estimate(entries, wrong, lit):
    """Relative L2 error of the matrix from independent draws, with its interval.

    Parameters
    ----------
    entries, wrong, lit : int
        Draws, those that were wrong, those that are really lit.
    """
    if not entries:
        return Estimate(0.0, 0.0, 0.0)
    low, high = binomial_interval(wrong, entries)
    # Where nothing is lit the error counts against all the light there might be.
    shares = np.array([wrong / entries, low, high]) * entries / (lit or entries)
    return Estimate(*map(float, np.sqrt(shares)))


def _brightness(worth, lights):
    """(n_directions,) squared radiance, each light by its share of the whole."""
    total = np.zeros(len(worth))
    for light in lights.values():
        power = (np.asarray(light, np.float64) ** 2).sum(axis=1)
        if power.any():
            total += power / (worth @ power)
    return total if total.any() else np.ones(len(worth))


class _Draws:
    """Independent draws of entries of one object, and what they found."""

    def __init__(self, scene, cube_map, tracer, sampled, points, rng):
        self._scene, self._cube_map, self._tracer = scene, cube_map, tracer
        self._sampled, self._points, self._rng = sampled, points, rng
        # How often each direction was proposed, in all points together, if all cosines were 1.
        self._rate = np.zeros(cube_map.n_directions)
        self._wrong = []
        self.rays = 0

    def all_known(self):
        """Whether no entry of the object is left to be wrong."""
        for first in range(0, len(self._points), _SIZE_ROWS):
            block = self._points[first : first + _SIZE_ROWS]
            left = horizon_bits(self._scene, self._cube_map, block) & ~self._sampled.traced[block]
            if left.any():
                return False
        return True

    def draw(self, worth, n_entries):
        """Draw about `n_entries` entries by their worth; counts of all, wrong and lit ones."""
        vectors, rng = self._cube_map.vectors, self._rng
        share = worth / worth.sum()
        ways = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        normals = np.ascontiguousarray(self._scene.points.normals[self._points].T)
        samples = self._cube_map.samples.astype(np.float32)
        bits, traced = self._sampled.bits, self._sampled.traced
        counts = dict.fromkeys(("entries", "wrong", "lit"), 0)
        # A direction by its whole worth, a point evenly, kept by the square of their cosine: one
        # in six is. So the draws are independent, and no sum over the matrix is needed.
        proposals = self._proposals = 6 * n_entries
        ways_drawn, drawn_entries = np.arange(len(worth)), []
        self._rate += proposals * share
        for first in range(0, proposals, _BATCH):
            count = min(_BATCH, proposals - first)
            times = rng.multinomial(count, share)
            drawn = rng.integers(0, len(self._points), count, np.int32)
            cosine = np.zeros(count, np.float32)
            for normal, way in zip(normals, ways.T, strict=True):
                cosine += normal.take(drawn) * np.repeat(way, times)
            kept = (cosine > 0) & (cosine * cosine > rng.random(count, np.float32))
            drawn_entries.append((self._points[drawn[kept]], np.repeat(ways_drawn, times)[kept]))
        # Looked up all together: the rows may lie in a file, in many pieces.
        point, direction = (np.concatenate(parts) for parts in zip(*drawn_entries, strict=True))
        byte, bit = direction >> 3, (direction & 7).astype(np.uint8)
        said = (bits[point, byte] >> bit) & 1 > 0
        known = (traced[point, byte] >> bit) & 1 > 0
        geometric = self._scene.points.geometric_normals
        ends = np.cumsum([len(batch) for batch, _ in drawn_entries])
        for part in map(slice, np.append(0, ends), ends):
            p, d = point[part], direction[part]
            above = np.einsum("ij,ij->i", geometric[p], samples[d]) > 0
            asked = np.flatnonzero(above & ~known[part])
            self.rays += len(asked)
            lit = said[part].copy()
            lit[asked] = yield from self._tracer.trace_pairs(p[asked], d[asked])
            self._wrong.append(p[lit != said[part]])
            counts["entries"] += len(p)
            counts["wrong"] += len(self._wrong[-1])
            counts["lit"] += int(lit.sum())
        return counts

    def relit(self, lights, n_rows):
        """Relit error under each light, from the rows in which draws were wrong."""
        rows, times = np.unique(np.concatenate(self._wrong), return_counts=True)
        # Too many rows are thinned, but not those that were found again and again.
        share = _kept_share(times, n_rows)
        rows = rows[self._rng.random(len(rows)) < share * times]
        sizes, estimates = self._sizes(lights), {}
        said, true = yield from self._whole_rows(rows)
        n_directions, vectors = self._cube_map.n_directions, self._cube_map.vectors
        cosine = np.maximum(self._scene.points.normals[rows].astype(np.float64) @ vectors.T, 0)
        said, true = (cosine * unpack(bits, n_directions, np.float64) for bits in (said, true))
        length = np.linalg.norm(vectors, axis=1)
        variance = ((cosine / length) ** 2 * (said != true)) @ self._rate / len(self._points)
        sure = _inclusion(variance, share)
        # How much of a row, in standard deviations, is left to chance.
        chance = np.sqrt(1 - np.minimum(sure, _SUREST)) / sure
        for name, light in lights.items():
            light = np.asarray(light, np.float64)
            error = (((true - said) @ light) ** 2).sum(axis=1)
            gain = ((true @ light) ** 2).sum(axis=1) - ((said @ light) ** 2).sum(axis=1)
            # What is received is known of what was said; the rows tell how far that is off, too.
            # Where almost nothing is left of it, it would be divided by chance.
            size = max(sizes[name] + (gain / sure).sum(), sizes[name] / 4)
            if not size:
                estimates[name] = Estimate(float(error.any()), 0.0, float(light.any()))
                continue
            ratio = (error / sure).sum() / size
            # What a row adds to the ratio's standard deviation (Cochran 1977, chapter 6). Of a row
            # that is hardly ever found it is what the row adds to the ratio: a Poisson event.
            weights = np.abs(error - ratio * gain) * chance / size
            # What a single wrong entry weighs, wherever it is, when draws follow this light. Where
            # rows were found, half: with all of it intervals held 99 to 100 times of 100, with a
            # quarter some held 75.
            single = length**2 @ (light**2).sum(axis=1) * len(lights) * len(self._points)
            single /= self._proposals * share * size
            bounds = weighted_interval(weights, single / 2 if len(rows) else single)
            sure_part = ratio - weights.sum()
            bounds = np.maximum([ratio, *(sure_part + bound for bound in bounds)], 0)
            estimates[name] = Estimate(*map(float, np.sqrt(bounds)))
        return estimates, len(rows)

    def _whole_rows(self, rows):
        """What was said of some points, and the truth, which then is put into the result."""
        said = self._sampled.bits[rows]
        asked = horizon_bits(self._scene, self._cube_map, rows) & ~self._sampled.traced[rows]
        free = yield from self._tracer.trace(rows, asked)
        true = said & ~asked | free
        self._sampled.bits[rows] = true
        self._sampled.traced[rows] |= asked
        return said, true

    def _sizes(self, lights):
        """Sum over the object's points of what they are said to receive squared, times pi^2."""
        sample = self._points
        if len(sample) > _SIZE_ROWS:
            sample = np.sort(self._rng.choice(sample, _SIZE_ROWS, replace=False))
        normals, bits = self._scene.points.normals[sample], self._sampled.bits[sample]
        together = np.hstack(list(lights.values()))
        received = received_light(bits, normals, self._cube_map, together).astype(np.float64)
        sums = (received**2).sum(axis=0).reshape(len(lights), -1).sum(axis=1)
        sums *= len(self._points) / len(sample) * np.pi**2
        return dict(zip(lights, sums, strict=True))


def _kept_share(times, n_rows):
    """Rows found `times` often are kept with `min(1, share * times)`: n_rows of them, expected."""
    if len(times) <= n_rows:
        return 1.0
    times = np.sort(times)[::-1]
    # The first of them are kept surely, and leave the rest of n_rows to the others.
    share = (n_rows - np.arange(len(times))) / times[::-1].cumsum()[::-1]
    return float(share[np.argmax(share * times < 1)])


def _inclusion(rate, share):
    """P(a row is found and kept): a Poisson count of a rate, then `min(1, share * count)`."""
    rate = np.maximum(rate, 1e-300)
    most = np.ceil(1 / share) - 1  # Of these counts and less, rows are thinned.
    return share * rate * gammaincc(most, rate) + gammainc(most + 1, rate)


def probe_lights(cube_map):
    """An even sky, and a soft sun low and high in it: lights where no others are given.

    Parameters
    ----------
    cube_map : CubeMap

    Returns
    -------
    dict of str -> (n_directions, 3) float32
    """
    expect_kind("cube_map", cube_map, CubeMap)
    towards = {"low sun": [0.8, 0.3, 0.52], "high sun": [-0.3, -0.4, 0.87]}
    lights = {"even sky": np.ones((cube_map.n_directions, 3), np.float32)}
    for name, way in towards.items():
        lobe = np.exp(40 * (cube_map.directions @ way / np.linalg.norm(way) - 1))
        lights[name] = np.repeat((0.1 + 5 * lobe)[:, None], 3, axis=1).astype(np.float32)
    return lights
