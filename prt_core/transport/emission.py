"""Direct light of emissive surfaces at the bake points: what K then bounces.

Two ways to find it, each good where the other is poor: cosine-distributed rays, which meet an
emitter often where it fills much of what a point sees (a sky made of a mesh, a panel at hand), and
shadow rays to places on the emitter (a tube, a screen across the room). Both are cast, and each
sample is weighed by how likely either way was to find it: the power heuristic of multiple
importance sampling (Veach and Guibas 1995), which counts nothing twice, has no bright dots where a
wall touches a lamp, and leaves what one way finds surely to it.

Where after the first turns the first kind alone is as good as both together, as under a sky, a
block of points goes on with it alone; where it hardly ever meets an emitter, with few of it.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    expect,
    expect_caster,
    expect_indices,
    expect_kind,
    expect_number,
    expect_seed,
    expect_whole,
)
from prt_core.rays import Hits
from prt_core.runtime.seeds import Stage, generator
from prt_core.scene import Scene
from prt_core.sphere import sobol_points
from prt_core.transport.gather import cosine_directions, first_of
from prt_core.transport.lamps import before_the_lamp
from prt_core.transport.surface_light import MOST_CLUSTERS, SurfaceLight

# Rays of each kind that a point casts in a turn; turns go in pairs, whose halves are compared.
TURN = 32
MOST_TURNS = 32
# The share of all cosine-distributed rays that has to meet an emitter for them to do alone; and
# that all emitters together have to be met by for more than _FEW of them to be cast in a turn.
_OFTEN, _SELDOM, _FEW = 1 / 8, 1 / 16, 8
# Clusters of all emitters together, and of one where there are hundreds.
_ALL_CLUSTERS, _FEWEST_CLUSTERS = 2048, 8
# Points on either side that say how far off one of a block is.
_BESIDE = 8
# Received light less than so much of an emitter's mean radiance is as good as none.
_NOTHING = 1e-9
# Received light of an emitter: in its own three colours, and of its largest channel alone, which
# is what it sends out in any other colour.
CHANNELS = 4


@dataclass(frozen=True)
class Emitted:
    """What some points receive of each emitter, directly.

    Attributes
    ----------
    received : (n_emitters, n, CHANNELS) float32
        Irradiance / pi: red, green, blue, and what it would be if each place of the emitter had
        its largest channel as radiance.
    spread, size : (n_emitters,) float64
        Squares, summed over points and channels, of the error (half the difference of two
        independent halves of the rays) and of what is received.
    n_rays : int
        That were cast.
    """

    received: np.ndarray
    spread: np.ndarray
    size: np.ndarray
    n_rays: int


def surface_lights(scene):
    """The `SurfaceLight` of each emitter of a scene.

    Parameters
    ----------
    scene : Scene
    """
    expect_kind("scene", scene, Scene)
    count = len(scene.emitters)
    # A point has a chance for each cluster of all emitters.
    n_clusters = max(_FEWEST_CLUSTERS, min(MOST_CLUSTERS, _ALL_CLUSTERS // max(count, 1)))
    return [SurfaceLight(scene, index, n_clusters) for index in range(count)]


def emitted_light(scene, caster, lights, points, seed, tolerance=0.01, most_turns=MOST_TURNS):
    """What a block of points receives of each emitter: `Emitted`.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    lights : sequence of SurfaceLight
        That have looked around.
    points : slice or (n,) int
        The random numbers depend on the first of them, and on the seed, alone.
    seed : int
    tolerance : float
        Relative error of what the block receives of an emitter at which no more rays are cast.
    most_turns : int
        Of TURN rays of each kind, even.
    """
    expect_kind("scene", scene, Scene)
    expect_caster(caster)
    if not isinstance(points, slice):
        points = expect_indices("points", points, len(scene.points))
        expect(len(points), "points: expected at least one")
    expect_number("tolerance", tolerance, above=0)
    expect_whole("most_turns", most_turns, 2)
    block = _Block(scene, caster, lights, points, expect_seed(seed))
    n = len(block.blind)
    # What both kinds of rays find together, and what cosine-distributed ones find alone.
    ways = np.zeros((2, 2, len(lights), n, CHANNELS))
    turns, best = np.zeros((len(lights), n), np.int64), np.zeros(len(lights), np.int64)
    spread, size = np.zeros((2, len(lights)))
    # Which points go on casting rays for each emitter.
    active = np.repeat([[not light.is_dark] for light in lights], n, axis=1)
    active &= ~block.blind
    for pair in range(most_turns // 2):
        if not active.any():
            break
        for half in (0, 1):
            block.turn(half, pair, active, best == 0, ways[:, half])
        turns += active
        if pair == 0:
            block.look_less()
        for i in np.flatnonzero(active.any(axis=1)):
            means = ways[:, :, i] / np.maximum(turns[i], 1)[:, None]
            spreads = ((means[:, 0] - means[:, 1]) ** 2).sum(axis=2) / 4
            if pair == 0:
                # That few rays agree by chance says nothing.
                often = block.met[i] >= _OFTEN * max(block.n_looked, 1)
                best[i] = often and spreads[1].sum() <= spreads[0].sum()
            spread[i] = spreads[best[i]].sum()
            size[i] = (means[best[i]].mean(axis=0) ** 2).sum()
            allowed = tolerance**2 * size[i]
            nothing = size[i] <= n * (_NOTHING * lights[i].radiance.max()) ** 2
            done = nothing or spread[i] <= allowed
            active[i] &= ~done & _tells(spreads[best[i]], allowed / 2)
    received = ways.sum(axis=1)[best, np.arange(len(lights))]
    received /= np.maximum(2 * turns, 1)[:, :, None]
    return Emitted(received.astype(np.float32), spread, size, block.n_rays)


def _tells(spread, allowed):
    """(n,) bool: all points but those whose `spread` (n,) is small, `allowed` together.

    By chance both halves of a point's rays may agree: it is taken to be as far off as those beside
    it are in the mean.
    """
    beside = np.ones(2 * _BESIDE + 1) / (2 * _BESIDE + 1)
    spread = np.maximum(spread, np.convolve(spread, beside)[_BESIDE : _BESIDE + len(spread)])
    order = np.argsort(spread, kind="stable")
    tells = np.empty(len(spread), bool)
    tells[order] = np.cumsum(spread[order]) > allowed
    return tells


class _Block:
    """Points whose rays are cast together."""

    def __init__(self, scene, caster, lights, points, seed):
        self._scene, self._caster, self._lights = scene, caster, lights
        self._start, self._seed, self.n_rays = first_of(points), seed, 0
        self._origins = scene.ray_origins[points]
        self._normals = scene.points.normals[points]
        self._geometric = scene.points.geometric_normals[points]
        # What nothing can be in front of has no emitter in front of it either.
        self.blind = scene.open_points[points]
        # Of cosine-distributed rays: those that met each emitter, and all.
        self._first, self._looks = 0, TURN
        self.met, self.n_looked = np.zeros(len(lights), np.int64), 0
        places, normals = self._origins.astype(np.float64), self._normals.astype(np.float64)
        self._chances = [light.chances(places, normals) for light in lights]

    def turn(self, half, pair, active, aiming, ways):
        """Add what a turn of each kind of rays finds to `ways`.

        Parameters
        ----------
        half, pair : int
        active : (n_emitters, n) bool
            Points that cast rays for each emitter.
        aiming : (n_emitters,) bool
            Emitters to which the second kind is cast.
        ways : (2, n_emitters, n, CHANNELS) float64
        """
        self._meet(half, pair, active, aiming, ways)
        self._aim(half, pair, active & aiming[:, None], ways[0])

    def look_less(self):
        """Cast few cosine-distributed rays from now on where they hardly ever meet an emitter."""
        if self.met.sum() < _SELDOM * self.n_looked:
            self._first, self._looks = TURN - _FEW, _FEW

    def _meet(self, half, pair, active, aiming, ways):
        """Cosine-distributed rays, and which emitters they meet."""
        n = len(self._normals)
        shift = generator(self._seed, Stage.EMISSION_RAYS, half, self._start)
        shift = shift.random((n, 2), np.float32)
        looks = self._looks
        directions = cosine_directions(self._normals, shift, looks, self._first + pair * looks)
        above = np.matmul(directions, self._geometric[:, :, None])[:, :, 0] > 0
        above &= active.any(axis=0)[:, None]
        point = np.nonzero(above)[0]
        directions = directions[above]
        if not len(point):
            return
        self.n_looked += len(point)
        hits = self._cast(self._origins[point], directions)
        met = np.where(hits.triangle >= 0, self._scene.triangle_emitter[hits.triangle], -1)
        for i in np.unique(met[met >= 0]):
            rows = np.flatnonzero((met == i) & active[i, point])
            self.met[i] += len(rows)
            triangle, barycentric = hits.triangle[rows], hits.barycentric[rows]
            sent = self._sent(triangle, barycentric, directions[rows])
            sent /= self._chance(triangle, barycentric, directions[rows])
            _add(ways[1, i], point[rows], sent / looks)
            if aiming[i]:
                places = point[rows], triangle, barycentric, directions[rows]
                by_rays, by_aim = self._densities(i, *places, hits.distance[rows].astype(float))
                _add(ways[0, i], point[rows], sent * _share(by_rays, by_aim)[:, None] / looks)

    def _aim(self, half, pair, active, sums):
        """Shadow rays to places on the emitters."""
        uv = sobol_points(int(np.ceil(np.log2((pair + 1) * TURN))))
        uv = uv[pair * TURN : (pair + 1) * TURN]
        aimed = []
        for i in np.flatnonzero(active.any(axis=1)):
            seeing = np.flatnonzero(active[i] & self._chances[i].any(axis=1))
            if not len(seeing):
                continue
            shift = generator(self._seed, Stage.EMISSION_SAMPLES, half, i, self._start)
            shifted = (uv[None] + shift.random((len(self._normals), 1, 2))[seeing]) % 1.0
            triangle, barycentric, _ = self._lights[i].sample(self._chances[i][seeing], shifted)
            point = np.repeat(seeing, TURN)
            triangle, barycentric = triangle.ravel(), barycentric.reshape(-1, 2)
            way = self._place(triangle, barycentric) - self._origins[point]
            distance = np.linalg.norm(way, axis=1)
            direction = way / np.maximum(distance, 1e-300)[:, None]
            above = np.einsum("nx,nx->n", direction, self._normals[point]) > 0
            above &= np.einsum("nx,nx->n", direction, self._geometric[point]) > 0
            keep = np.flatnonzero(above & (distance > 0))
            aimed.append(
                (i, *(x[keep] for x in (point, triangle, barycentric, direction, distance)))
            )
        if not sum(len(each[1]) for each in aimed):
            return
        point, direction, distance = (
            np.concatenate([each[k] for each in aimed]) for k in (1, 4, 5)
        )
        free = self._free(self._origins[point], direction, distance)
        first = 0
        for i, *samples in aimed:
            seen = np.flatnonzero(free[first : first + len(samples[0])])
            first += len(samples[0])
            point, triangle, barycentric, *way = (values[seen] for values in samples)
            by_rays, by_aim = self._densities(i, point, triangle, barycentric, *way)
            # Radiance L brings L cosine / pi for each unit of solid angle: L times the density of
            # the cosine-distributed rays, over that of the sample.
            sent = self._sent(triangle, barycentric, way[0])
            weight = _share(by_aim, by_rays) * by_rays / (by_aim * self._looks)
            _add(sums[i], point, sent * weight[:, None])

    def _densities(self, i, point, triangle, barycentric, direction, distance):
        """How many samples of either kind go a way in a turn, for unit of solid angle, (m,)."""
        cosine = np.einsum("nx,nx->n", direction, self._normals[point].astype(np.float64))
        normal = self._scene.triangle_normals[triangle].astype(np.float64)
        faced = np.abs(np.einsum("nx,nx->n", direction, normal))
        by_area = self._lights[i].density(self._chances[i], point, triangle, barycentric)
        by_rays = self._looks * np.maximum(cosine, 0) / np.pi
        return by_rays, TURN * by_area * distance**2 / np.maximum(faced, 1e-12)

    def _sent(self, triangle, barycentric, directions):
        """(m, CHANNELS) float64 radiance of places on emitters, against rays along directions."""
        emission = self._scene.emission_at(triangle, barycentric, self._back(triangle, directions))
        return np.column_stack([emission, emission.max(axis=1)])

    def _back(self, triangle, directions):
        """(m,) bool: whether rays along directions meet the backs of triangles."""
        return np.einsum("nx,nx->n", directions, self._scene.triangle_normals[triangle]) > 0

    def _chance(self, triangle, barycentric, directions):
        """(m, 1) float64 how likely a ray that gets to places of triangles ends there."""
        opacity, share = self._scene.opacity, np.ones((len(triangle), 1))
        if opacity is not None:
            passing = np.flatnonzero(opacity.passing[triangle])
            back = self._back(triangle[passing], directions[passing])
            share[passing, 0] = opacity.at(triangle[passing], barycentric[passing], back)
        return share

    def _place(self, triangle, barycentric):
        """(m, 3) float64 positions on triangles."""
        a, b, c = np.moveaxis(self._scene.vertices[self._scene.triangles[triangle]], 1, 0)
        return a + barycentric[:, :1] * (b - a) + barycentric[:, 1:] * (c - a)

    def _cast(self, origins, directions):
        self.n_rays += len(origins)
        size = self._caster.batch
        return Hits.joined(
            [
                self._caster.intersect(
                    origins[first : first + size], directions[first : first + size]
                )
                for first in range(0, len(origins), size)
            ]
        )

    def _free(self, origins, directions, distances):
        """(m,) bool: whether nothing is in the way to places so far off."""
        self.n_rays += len(origins)
        limits = before_the_lamp(origins, directions, distances)
        directions, size = directions.astype(np.float32), self._caster.batch
        parts = [slice(first, first + size) for first in range(0, len(origins), size)]
        return ~np.concatenate(
            [self._caster.occluded(origins[p], directions[p], limits[p]) for p in parts]
        )


def _add(sums, point, values):
    """Add `values` (m, CHANNELS) to the `sums` (n, CHANNELS) of their points."""
    for channel, column in enumerate(values.T):
        sums[:, channel] += np.bincount(point, column, len(sums))


def _share(own, other):
    """(m,) what counts of samples by the power heuristic, of their own density and the other."""
    return own**2 / np.maximum(own**2 + other**2, 1e-300)
