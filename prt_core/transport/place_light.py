"""What places on surfaces receive under a few lights: what tells where meshes are too coarse.

The lights are those of the scene: its lamps, each by its own shadow rays, and its world, whose few
brightest texels are asked for one by one and the rest by coarse texels. Beside them an even sky
stands for the light that bounces, as a part of all light. Where a scene has neither lamps nor a
world, two hard suns stand for the light that will come. Only light that arrives directly is taken:
what bounces has no sharp edges but those that a sky has, where surfaces meet.
"""

from dataclasses import dataclass, replace

import numpy as np

from prt_core.light.local import Lamp
from prt_core.runtime.progress import Progress
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import CubeMap, tangents
from prt_core.transport.lamps import lamp_steps

# Texels along an edge of the cube map whose middles stand for the sky.
SKY = 8
# Texels of the world that have a direction of their own: at most so many, each with more than
# this share of all of its light.
_MOST_BRIGHT, _BRIGHT = 32, 1 / 256
# The part of all light that bounces, about: what errors under an even sky count as.
_BOUNCED = 0.25
# Shadow rays of a lamp that is not small.
_SAMPLES = 64
# Towards the suns that stand for any light, as the certificate's; rays cast together.
_SUNS = ((0.8, 0.3, 0.52), (-0.3, -0.4, 0.87))
_RAYS = 1 << 18


@dataclass(frozen=True)
class Channel:
    """One light: the group it belongs to, and its lamp or its column of the directions.

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
    seed : int

    Attributes
    ----------
    channels : list of Channel
        Those of one group shine together.
    rays : int
    """

    def __init__(self, scene, caster, shadows, lamps=(), world=None, seed=0):
        self._scene, self._caster, self._shadows, self._seed = scene, caster, shadows, seed
        self.rays, lamps = 0, list(lamps)
        dark = world is None or not world.any()
        sky = CubeMap(SKY)
        self._ways, columns = sky.directions, [sky.solid_angles]
        self.channels = [Channel("bounced light", _BOUNCED, column=0)]
        if not dark:
            ways, weights = _directions_of(world, sky)
            self._ways = np.concatenate([self._ways, ways])
            columns = [np.append(columns[0], np.zeros(len(ways))), weights]
            self.channels.append(Channel("the world", column=1))
        self._weights = np.stack(columns, axis=1) / np.pi
        if dark and not lamps:
            lamps = [_sun(way) for way in _SUNS]
        for lamp in lamps:
            group = "the world" if lamp.of_world else "the lamps"
            self.channels.append(Channel(group, lamp=lamp))

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
                values[:, index] = skies[:, channel.column]
                continue
            lamp, count = channel.lamp, 1 if channel.lamp.is_small else _SAMPLES
            # The same seed for all rounds and places: a lamp's samples are even over it anyway.
            steps = lamp_steps(asked, self._shadows(lamp), lamp, count, (self._seed, index))
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

        firsts = range(0, len(points), step)
        if self._caster.threads > 1:
            self.rays += sum(on_all_cores(one, firsts) or ())
            yield Progress("refine", 0, 0)
        else:
            for first in firsts:
                self.rays += one(first)
                yield Progress("refine", 0, 0)
        return result


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


def _sun(way):
    """A hard sun that stands in a direction."""
    way = np.array(way) / np.linalg.norm(way)
    across = tangents(way[None])
    axes = np.stack([across[0][0], across[1][0], way], axis=1)
    return Lamp("sun", [np.pi] * 3, axes=axes, name="a sun")
