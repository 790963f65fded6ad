"""What places on surfaces receive under a few lights: what tells where meshes are too coarse.

The lights are those of the scene: its lamps, each by its own shadow rays; its world, whose few
brightest texels are asked for one by one and the rest by coarse texels; what shines itself, by
places on it that are the same for all. Beside them an even sky stands for the light that bounces,
as a part of all light. Where a scene has none of those, two hard suns stand for the light that will
come. Only light that arrives directly is taken: what bounces has no sharp edges but those that a
sky has, where surfaces meet.
"""

from dataclasses import dataclass, replace

import numpy as np

from prt_core.light.local import Lamp
from prt_core.runtime.progress import Progress
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import CubeMap, tangents
from prt_core.transport.lamps import lamp_steps

# Texels along an edge of the cube map whose middles stand for the sky; and of more places than so
# many, fewer.
SKY, _FEWER_SKY, _MANY = 6, 4, 500_000
# Texels of the world that have a direction of their own: at most so many, each with more than
# this share of all of its light.
_MOST_BRIGHT, _BRIGHT = 32, 1 / 256
# The part of all light that bounces, about: what errors under an even sky count as.
_BOUNCED = 0.25
# Shadow rays of a lamp that is not small, at least and at most; of all places and lamps together,
# about. Places on surfaces that shine, and how far before them rays end.
_SAMPLES, _ALL_SAMPLES, _SHINING, _SHORT = (8, 32), 1 << 26, 64, 1 - 1e-4
# Towards the suns that stand for any light, as the certificate's; rays cast together.
_SUNS = ((0.8, 0.3, 0.52), (-0.3, -0.4, 0.87))
_RAYS = 1 << 18


@dataclass(frozen=True)
class Channel:
    """One light: the group it belongs to, and its lamp or its column of the directions; or neither,
    for what shines itself.

    `share` is the part of all light that an error relative to it counts as.
    """

    group: str
    share: float = 1.0
    lamp: Lamp | None = None
    column: int = -1


class PlaceLight:
    """Light at places of a scene, a channel for each lamp, one for the world and one for a sky.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
        For the sky and the world.
    shadows : callable(Lamp) -> RayCaster or None
        What is in the way of a lamp.
    lamps : sequence of Lamp
    world : (n_directions, 3) float32, optional
        Radiance on the texels of a cube map.
    count : int
        Places that will be asked for, about: of very many each gets fewer rays.

    Attributes
    ----------
    channels : list of Channel
        Those of one group shine together.
    rays : int
    """

    def __init__(self, scene, caster, shadows, lamps=(), world=None, count=0):
        self._scene, self._caster, self._shadows = scene, caster, shadows
        self.rays, lamps = 0, list(lamps)
        dark = world is None or not world.any()
        sky = CubeMap(SKY if count <= _MANY else _FEWER_SKY)
        self._ways, columns = sky.directions, [sky.solid_angles]
        self.channels = [Channel("bounced light", _BOUNCED, column=0)]
        if not dark:
            ways, weights = _directions_of(world, sky)
            self._ways = np.concatenate([self._ways, ways])
            columns = [np.append(columns[0], np.zeros(len(ways))), weights]
            self.channels.append(Channel("the world", column=1))
        self._weights = np.stack(columns, axis=1) / np.pi
        self._shining = _shining_places(scene)
        if self._shining is not None:
            self.channels.append(Channel("what shines"))
        for lamp in lamps:
            group = "the world" if lamp.of_world else "the lamps"
            self.channels.append(Channel(group, lamp=lamp))
        if len(self.channels) == 1:
            self.channels += [Channel("two suns", lamp=_sun(way)) for way in _SUNS]
        fewest, most = _SAMPLES
        self._samples = int(np.clip(_ALL_SAMPLES / max(count * len(lamps), 1), fewest, most))

    def steps(self, points):
        """Irradiance / pi of each channel at points; a generator of `Progress`.

        Parameters
        ----------
        points : BakePoints

        Returns
        -------
        (n, n_channels) float64
            Means of red, green and blue.
        """
        values = np.zeros((len(points), len(self.channels)))
        asked = replace(self._scene, points=points)
        asked.frames = self._scene.frames
        skies = yield from self._sky_steps(asked)
        for index, channel in enumerate(self.channels):
            if channel.lamp is None:
                if channel.column < 0:
                    values[:, index] = yield from self._shining_steps(asked)
                else:
                    values[:, index] = skies[:, channel.column]
                continue
            lamp, count = channel.lamp, 1 if channel.lamp.is_small else self._samples
            caster = self._shadows(lamp)
            steps = lamp_steps(asked, caster, lamp, count, alike=True)
            values[:, index] = (yield from _hushed(steps)).mean(axis=1)
            self.rays += count * len(points)
        return values

    def _sky_steps(self, scene):
        """(n, n_columns) of what comes from the directions."""
        points, ways = scene.points, self._ways.astype(np.float32)
        result = np.zeros((len(points), self._weights.shape[1]))
        origins, step = scene.ray_origins, max(1, _RAYS // len(ways))

        def one(first):
            part = slice(first, first + step)
            cosine = points.normals[part] @ ways.T
            above = (cosine > 0) & (points.geometric_normals[part] @ ways.T > 0)
            place, way = np.nonzero(above)
            if len(place):
                above[place, way] = ~self._caster.occluded(origins[part][place], ways[way])
            result[part] = np.where(above, cosine, 0) @ self._weights
            return len(place)

        yield from self._in_parts(one, range(0, len(points), step))
        return result

    def _shining_steps(self, scene):
        """(n,) of what comes from places on surfaces that shine."""
        points = scene.points
        places, normals, areas, radiance = self._shining
        result, step = np.zeros(len(points)), max(1, _RAYS // len(places))
        origins = scene.ray_origins

        def one(first):
            part = slice(first, first + step)
            ways = places[None] - origins[part][:, None]
            squares = np.einsum("psx,psx->ps", ways, ways)
            ways /= np.sqrt(np.maximum(squares, 1e-30))[..., None]
            cosine = np.einsum("px,psx->ps", points.normals[part], ways)
            above = np.einsum("px,psx->ps", points.geometric_normals[part], ways) > 0
            # A disc as large as what each place stands for, by either of its faces.
            gives = np.maximum(cosine, 0) * above * np.abs(np.einsum("sx,psx->ps", normals, ways))
            gives *= radiance * areas / (np.pi * squares + areas)
            point, place = np.nonzero(gives > 0)
            if len(point):
                limit = np.sqrt(squares[point, place]) * _SHORT
                blocked = self._caster.occluded(
                    origins[part][point], ways[point, place].astype(np.float32),
                    limit.astype(np.float32),
                )  # fmt: skip
                gives[point[blocked], place[blocked]] = 0
            result[part] = gives.sum(axis=1)
            return len(point)

        yield from self._in_parts(one, range(0, len(points), step))
        return result

    def _in_parts(self, one, firsts):
        """Parts of the work, which return how many rays they cast, on all cores where rays may."""
        if self._caster.threads > 1:
            self.rays += sum(on_all_cores(one, firsts))
            yield Progress("refine", 0, 0)
            return
        for first in firsts:
            self.rays += one(first)
            yield Progress("refine", 0, 0)


def _hushed(steps):
    """The steps of a generator, as those of a stage that counts something else."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value
        yield Progress("refine", 0, 0)


def _directions_of(world, sky):
    """Directions that stand for a world on texels, and (n_sky + n, ) weights: radiance x angle."""
    cube = CubeMap(round((len(world) / 6) ** 0.5))
    power = world.mean(axis=1, dtype=np.float64) * cube.solid_angles
    order = np.argsort(power, kind="stable")[::-1][:_MOST_BRIGHT]
    bright = order[power[order] > _BRIGHT * power.sum()]
    rest = power.copy()
    rest[bright] = 0
    weights = np.bincount(sky.texel_of(cube.directions), rest, sky.n_directions)
    return cube.directions[bright], np.append(weights, power[bright])


def _shining_places(scene):
    """Places on surfaces that shine, more where that is more; None where nothing does.

    Returns
    -------
    places, normals : (n, 3) float64
    areas : (n,) float64
        What each stands for.
    radiance : (n,) float64
    """
    triangles = np.flatnonzero(scene.triangle_emitter >= 0)
    if not len(triangles):
        return None
    middle, front = np.full((len(triangles), 2), 1 / 3), np.zeros(len(triangles), bool)
    radiance = scene.emission_at(triangles, middle, front).mean(axis=1)
    corners = scene.vertices[scene.triangles[triangles]]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(cross, axis=1) / 2
    power = np.cumsum(areas * radiance)
    if not power[-1] > 0:
        return None
    number = np.arange(_SHINING)
    which = np.searchsorted(power, (number + 0.5) / _SHINING * power[-1], side="right")
    which = np.minimum(which, len(triangles) - 1)
    # Even over a triangle that has several (Roberts' sequence, folded).
    second, third = (number[:, None] * (0.7548776662466927, 0.5698402909980532) % 1).T
    over = second + third > 1
    second, third = np.where(over, 1 - second, second), np.where(over, 1 - third, third)
    weights = np.stack([1 - second - third, second, third], axis=1)
    share = power[-1] / _SHINING / np.maximum(radiance[which], 1e-30)
    places = np.einsum("sk,skx->sx", weights, corners[which])
    return places, scene.triangle_normals[triangles[which]], share, radiance[which]


def _sun(way):
    """A hard sun that stands in a direction."""
    way = np.array(way) / np.linalg.norm(way)
    across = tangents(way[None])
    axes = np.stack([across[0][0], across[1][0], way], axis=1)
    return Lamp("sun", [np.pi] * 3, axes=axes, name="a sun")
