"""Light from far away in one bake: read once, turned quickly, and what points get of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from prt_core.compress import IncrementalLighting
from prt_core.errors import expect, system_errors
from prt_core.light import EnvironmentMap, TurningLight, split_sun, sun_light
from prt_core.light.environment import expect_radiance, expect_strength
from prt_core.light.sky import Sky, with_suns
from prt_core.sphere import CubeMap

# Images, and lights to be turned, that stay in memory at once.
_MOST_IMAGES = 4
# Samples along each side of a pixel of the image of the world's texels.
_FINE = 4


class Environments:
    """Environments of one bake, kept until others push them out.

    Parameters
    ----------
    bake : Bake
    """

    def __init__(self, bake):
        self._bake = bake
        self.close()

    def close(self):
        """Let go of everything."""
        self._images, self._turning, self._last = {}, {}, (None, None)
        self._texels, self._world = ((None,), False, None), None

    def replace(self, bake):
        """See `Relighter.replace`."""
        # What points receive of a light is made of their rows alone.
        if bake.transport.bits is not self._bake.transport.bits:
            self._last = None, None
        self._bake = bake

    def read(self, lighting):
        """What a `Lighting` has of light from far away, as something that can be put on texels.

        Returns
        -------
        EnvironmentMap, (n_directions, 3) float32, or None
            An image, the light of the baked world, or light on the directions.
        """
        light = lighting.environment
        if lighting.is_world:
            light = self._bake.world
            expect(
                light is not None,
                "light 'world': the bake has none, its world was not understood; give an image",
            )
        elif isinstance(light, Path):
            light = self._image(light)
        elif light is not None and not lighting.is_image:
            light = expect_radiance("light", light, self._bake.cube_map)
        if light is not None:
            name = light.name if lighting.is_image else "light"
            values = light.pixels if lighting.is_image else light
            expect_strength(name, values, lighting.strength)
        return light

    def _image(self, path):
        with system_errors(path):
            stamp = path.stat().st_mtime_ns if path.is_file() else None
        if (path, stamp) not in self._images:
            while len(self._images) >= _MOST_IMAGES:
                self._images.pop(next(iter(self._images)))
            self._images[path, stamp] = EnvironmentMap.read(path)
        return self._images[path, stamp]

    def distant(self, light, lighting, evaluator=None):
        """What points receive of light from far away, and the sun that is left out of it.

        At strength 1 and before it bounces; with a compressed form, whose rows hold the bounces,
        after them, and so at the strength asked for: on every way strength is the light's.

        Parameters
        ----------
        light : EnvironmentMap, (n_directions, 3) float32 or None
            What `read` returns.
        lighting : Lighting
            How it is turned, and whether its sun is left out.
        evaluator : object, optional
            What relights a compressed form.

        Returns
        -------
        (n_points, 3) float32, or None
        BrightPixels, or None
        """
        if light is None:
            return None, None
        matrix, sharp = lighting.matrix, lighting.sharp_sun
        key, kept = self._last
        made_from = (
            matrix.tobytes(),
            sharp,
            evaluator,
            None if evaluator is None else lighting.strength,
        )
        same = key is not None and key[0] is light and key[1:] == made_from
        # An array that was given may have other values by now, and a form that comes nearer with
        # each frame has more to say of the same light.
        lasting = isinstance(light, EnvironmentMap) or light is self._bake.world
        lasting = lasting and not isinstance(evaluator, IncrementalLighting)
        if not same or not lasting:
            if evaluator is not None:
                radiance, sun = self._turned(light, matrix, sharp)
                kept = evaluator.product(radiance * np.float32(lighting.strength)), sun
            else:
                radiance, sun = self._placed(light, matrix, sharp)
                kept = self._bake.transport.received(radiance), sun
            self._last = (light, *made_from), kept
        return kept

    def _placed(self, light, matrix, sharp_sun):
        """Light on texels, and its sun; kept, for the bake may come nearer under the same light.

        Where the bake itself is coarse an image that was there before is turned quickly.
        """
        if not isinstance(light, EnvironmentMap):
            return light, None
        coarse = self._bake.transport.is_coarse
        (before, *how), exact, kept = self._texels
        if before is light and how == [matrix.tobytes(), sharp_sun] and (exact or coarse):
            return kept
        exact = not (coarse and before is light)
        if exact:
            rest, sun = split_sun(light, matrix) if sharp_sun else (light, None)
            kept = self._on_texels(rest, matrix), sun
        else:
            kept = self._turned(light, matrix, sharp_sun)
        self._texels = (light, matrix.tobytes(), sharp_sun), exact, kept
        return kept

    def _turned(self, light, matrix, sharp_sun):
        """Light on texels, and its sun; an environment is cut into parts once."""
        if not isinstance(light, EnvironmentMap):
            return light, None
        key = id(light), sharp_sun
        if key not in self._turning:
            rest, sun = split_sun(light) if sharp_sun else (light, None)
            while len(self._turning) >= _MOST_IMAGES:
                self._turning.pop(next(iter(self._turning)))
            # The environment is kept with it, so that its id stays its own.
            self._turning[key] = light, TurningLight(rest, self._bake.cube_map), sun
        _, turning, sun = self._turning[key]
        return turning.at(matrix), sun and replace(sun, rotation=matrix)

    def on_texels(self, lighting, without_sun=False, finer=1):
        """(n_directions, 3) float32 radiance of what a `Lighting` has of light from far away.

        None where it has only lamps, or no image that is finer than the bake's texels.

        Parameters
        ----------
        lighting : Lighting
        without_sun : bool
            Leave out what `distant` takes out as a sun.
        finer : int
            Texels along the edge of one of the bake's.
        """
        light = self.read(lighting)
        if light is None:
            return None
        if finer > 1:
            light = self._bake.world_image if lighting.is_world else light
            if not isinstance(light, EnvironmentMap):
                return None
            if without_sun:
                light = split_sun(light, lighting.matrix)[0]
            fine = CubeMap(finer * self._bake.cube_map.resolution)
            texels = light.to_cube_map(fine, lighting.matrix, finer=finer)
            for lamp in self._suns_on_texels(lighting):
                texels += sun_light(fine, lamp.towards, lamp.power, lamp.angle)
        else:
            texels, _ = self._placed(light, lighting.matrix, without_sun)
        return texels * np.float32(lighting.strength)

    def _on_texels(self, light, matrix):
        image = isinstance(light, EnvironmentMap)
        return light.to_cube_map(self._bake.cube_map, matrix) if image else light

    def sky(self, lighting, exposed=True):
        """The `Sky` behind the scene; None, which is black, where a `Lighting` has no light from
        far away but texels.

        The image itself, not the texels that light comes from. Of the baked scene's own world
        without an image of it: its texels, smoothed.

        Parameters
        ----------
        lighting : Lighting
        exposed : bool
            Whether its exposure counts.
        """
        if not (lighting.is_image or lighting.is_world):
            return None
        image = self.read(lighting)
        if lighting.is_world:
            image = self._bake.world_image or self._world_image(image)
        factor = lighting.strength * (lighting.exposure_factor if exposed else 1)
        return Sky(((image, lighting.matrix, factor),))

    def mirrored_sky(self, lighting):
        """What mirrors show of light from far away, as a function of (m, 3) directions.

        The `sky` without its exposure, and suns that are a part of the world's texels, which
        nobody sees behind the scene; None as there.
        """
        sky = self.sky(lighting, exposed=False)
        # Texels, smoothed or not, have them.
        suns = self._suns_on_texels(lighting) if self._bake.world_image else []
        factor = lighting.strength
        return with_suns(sky, [(lamp.towards, lamp.power * factor, lamp.angle) for lamp in suns])

    def _suns_on_texels(self, lighting):
        return [lamp for lamp in self._bake.lamps if lighting.is_world and lamp.is_on_texels]

    def _world_image(self, texels):
        """An image of light on the bake's texels: the mean of the texels under each pixel."""
        if self._world is None:
            n = self._bake.cube_map.resolution
            rows, columns = _FINE * 2 * n, _FINE * 4 * n
            turn = (0.5 - (np.arange(columns) + 0.5) / columns) * 2 * np.pi
            rise = (0.5 - (np.arange(rows) + 0.5) / rows) * np.pi
            rise, turn = (each.ravel() for each in np.meshgrid(rise, turn, indexing="ij"))
            level = np.cos(rise)
            directions = [level * np.cos(turn), level * np.sin(turn), np.sin(rise)]
            fine = texels[self._bake.cube_map.texel_of(np.stack(directions, axis=1))]
            blocks = fine.reshape(rows // _FINE, _FINE, columns // _FINE, _FINE, 3)
            self._world = EnvironmentMap(blocks.mean(axis=(1, 3)), "world")
        return self._world
