"""Direct light of emissive surfaces at the bake points: what K then bounces.

Two ways to find it, each good where the other is poor: cosine-distributed rays, which meet an
emitter often where it fills much of what a point sees (a sky made of a mesh, a panel at hand), and
shadow rays to places on the emitter (a tube, a screen across the room). Both are cast, as many of
one as of the other, and each sample is weighed by how likely either way was to find it: the
balance heuristic of multiple importance sampling (Veach and Guibas 1995), which counts nothing
twice and has no bright dots where a wall touches a lamp.

Where after the first turns the first kind alone is as good as both together, as under a sky, a
block of points goes on with it alone.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import (
    expect_caster,
    expect_kind,
    expect_number,
    expect_seed,
    expect_whole,
)
from prt_core.rays import Hits
from prt_core.runtime.seeds import Stage, generator
from prt_core.scene import Scene
from prt_core.sphere import sobol_points
from prt_core.transport.gather import cosine_directions
from prt_core.transport.lamps import before_the_lamp
from prt_core.transport.surface_light import SurfaceLight

# Rays of each kind that a point casts in a turn; turns go in pairs, whose halves are compared.
TURN = 32
MOST_TURNS = 32
# The share of all cosine-distributed rays that has to meet an emitter for them to do alone.
_OFTEN = 1 / 8
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


def surface_lights(scene, caster, seed=0):
    """The `SurfaceLight` of each emitter of a scene."""
    expect_kind("scene", scene, Scene)
    expect_caster(caster)
    expect_seed(seed)
    return [SurfaceLight(scene, index, caster, seed) for index in range(len(scene.emitters))]


def emitted_light(scene, caster, lights, points, seed, tolerance=0.01, most_turns=MOST_TURNS):
    """What a block of points receives of each emitter: `Emitted`.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    lights : sequence of SurfaceLight
        See `surface_lights`.
    points : slice
        The random numbers depend on where it starts, and on the seed, alone.
    seed : int
    tolerance : float
        Relative error of what the block receives of an emitter at which no more rays are cast.
    most_turns : int
        Of TURN rays of each kind, even.
    """
    expect_kind("scene", scene, Scene)
    expect_caster(caster)
    expect_kind("points", points, slice)
    expect_number("tolerance", tolerance, above=0)
    expect_whole("most_turns", most_turns, 2)
    block = _Block(scene, caster, lights, points, expect_seed(seed))
    n = points.stop - points.start
    # What both kinds of rays find together, and what cosine-distributed ones find alone.
    ways = np.zeros((2, 2, len(lights), n, CHANNELS))
    turns, best = np.zeros((2, len(lights)), np.int64)
    spread, size = np.zeros((2, len(lights)))
    active = [i for i, light in enumerate(lights) if not light.is_dark]
    for pair in range(most_turns // 2):
        if not active:
            break
        aiming = [i for i in active if best[i] == 0]
        for half in (0, 1):
            block.turn(half, pair, active, aiming, ways[:, half])
        turns[active] += 1
        for i in active:
            means = ways[:, :, i] / turns[i]
            spreads = ((means[:, 0] - means[:, 1]) ** 2).sum(axis=(1, 2)) / 4
            if pair == 0:
                # That few rays agree by chance says nothing.
                often = block.met[i] >= _OFTEN * max(block.n_looked, 1)
                best[i] = often and spreads[1] <= spreads[0]
            spread[i] = spreads[best[i]]
            size[i] = (means[best[i]].mean(axis=0) ** 2).sum()
        active = [
            i
            for i in active
            if spread[i] > tolerance**2 * size[i]
            and size[i] > n * (_NOTHING * lights[i].radiance.max()) ** 2
        ]
    received = ways.sum(axis=1)[best, np.arange(len(lights))]
    received /= np.maximum(2 * turns, 1)[:, None, None]
    return Emitted(received.astype(np.float32), spread, size, block.n_rays)


class _Block:
    """Points whose rays are cast together."""

    def __init__(self, scene, caster, lights, points, seed):
        self._scene, self._caster, self._lights = scene, caster, lights
        self._start, self._seed, self.n_rays = points.start, seed, 0
        self._origins = scene.ray_origins[points]
        self._normals = scene.points.normals[points]
        self._geometric = scene.points.geometric_normals[points]
        # What nothing can be in front of has no emitter in front of it either.
        self._blind = scene.open_points[points]
        # Of cosine-distributed rays: those that met each emitter, and all.
        self.met, self.n_looked = np.zeros(len(lights), np.int64), 0
        places, normals = self._origins.astype(np.float64), self._normals.astype(np.float64)
        self._chances = [light.chances(places, normals) for light in lights]
        for chances in self._chances:
            chances[self._blind] = 0

    def turn(self, half, pair, active, aiming, ways):
        """Add what TURN rays of each kind find of the `active` emitters to `ways`.

        The second kind is cast only to those that are `aiming`.
        """
        self._meet(half, pair, active, aiming, ways)
        self._aim(half, pair, aiming, ways[0])

    def _meet(self, half, pair, active, aiming, ways):
        """Cosine-distributed rays, and which emitters they meet."""
        n = len(self._normals)
        shift = generator(self._seed, Stage.EMISSION_RAYS, half, self._start)
        shift = shift.random((n, 2), np.float32)
        directions = cosine_directions(self._normals, shift, TURN, pair * TURN)
        above = np.matmul(directions, self._geometric[:, :, None])[:, :, 0] > 0
        above &= ~self._blind[:, None]
        point = np.nonzero(above)[0]
        directions = directions[above]
        if not len(point):
            return
        self.n_looked += len(point)
        found = self._cast(self._origins[point], directions)
        met = np.where(found.triangle >= 0, self._scene.triangle_emitter[found.triangle], -1)
        for i in active:
            mine = np.flatnonzero(met == i)
            self.met[i] += len(mine)
            if not len(mine):
                continue
            triangle, barycentric = found.triangle[mine], found.barycentric[mine]
            _add(ways[1, i], point[mine], self._sent(triangle, barycentric) / TURN)
            if i in aiming:
                some = point[mine], triangle, barycentric, directions[mine]
                self._weigh(i, *some, found.distance[mine].astype(np.float64), ways[0])

    def _aim(self, half, pair, active, sums):
        """Shadow rays to places on the emitters."""
        uv = sobol_points(int(np.ceil(np.log2((pair + 1) * TURN))))
        uv = uv[pair * TURN : (pair + 1) * TURN]
        aimed = []
        for i in active:
            seeing = np.flatnonzero(self._chances[i].any(axis=1))
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
        for i, *some in aimed:
            seen = np.flatnonzero(free[first : first + len(some[0])])
            first += len(some[0])
            self._weigh(i, *(values[seen] for values in some), sums)

    def _weigh(self, i, point, triangle, barycentric, direction, distance, sums):
        """Add samples of an emitter, by the balance heuristic.

        Sent radiance L brings L cosine / pi for each unit of solid angle: L times the density with
        which cosine-distributed rays go that way. TURN rays go there with that density, TURN with
        that of the emitter's samples.
        """
        light = self._lights[i]
        cosine = np.einsum("nx,nx->n", direction, self._normals[point].astype(np.float64))
        by_rays = np.maximum(cosine, 0) / np.pi
        normal = self._scene.triangle_normals[triangle].astype(np.float64)
        faced = np.abs(np.einsum("nx,nx->n", direction, normal))
        by_area = light.density(self._chances[i], point, triangle, barycentric)
        both = by_rays + by_area * distance**2 / np.maximum(faced, 1e-12)
        weight = np.where(by_rays > 0, by_rays / np.maximum(both, 1e-300), 0) / TURN
        _add(sums[i], point, self._sent(triangle, barycentric) * weight[:, None])

    def _sent(self, triangle, barycentric):
        """(m, CHANNELS) float64 radiance of places on emitters."""
        emission = self._scene.emission_at(triangle, barycentric)
        return np.column_stack([emission, emission.max(axis=1)])

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
