"""Light from far away in one bake: read once, turned quickly, and what points get of it."""

from dataclasses import replace
from pathlib import Path

from prt_core.errors import expect, expect_offers, expect_path, system_errors
from prt_core.light import EnvironmentMap, TurningLight, split_sun
from prt_core.light.environment import expect_radiance
from prt_core.sphere import rotation_matrix

# Images, and lights to be turned, that stay in memory at once.
_MOST_IMAGES = 4


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

    def read(self, light):
        """An `EnvironmentMap` where `light` is the path of an image, else `light` as it is."""
        if not isinstance(light, str | Path) or light == "world":
            return light
        path = expect_path("light", light)
        with system_errors(path):
            stamp = path.stat().st_mtime_ns if path.is_file() else None
        if (path, stamp) not in self._images:
            while len(self._images) >= _MOST_IMAGES:
                self._images.pop(next(iter(self._images)))
            self._images[path, stamp] = EnvironmentMap.read(path)
        return self._images[path, stamp]

    def distant(self, light, rotation, sharp_sun, quick):
        """What light from far away gives at strength 1, and the sun that is left out of it.

        Parameters
        ----------
        light : EnvironmentMap, "world", (n_directions, 3) array or None
        rotation
            See `rotation_matrix`.
        sharp_sun : bool
        quick : object or None
            What relights a compressed form.

        Returns
        -------
        (n_points, 3) float32, or None
            What every point receives; with a compressed form, what it sends out.
        BrightPixels, or None
        """
        if light is None:
            return None, None
        key, kept = self._last
        made_from = (rotation_matrix(rotation).tobytes(), sharp_sun, quick)
        same = key is not None and key[0] is light and key[1:] == made_from
        if not same or not isinstance(light, EnvironmentMap | str):
            if quick is not None:
                radiance, sun = self._turned(light, rotation, sharp_sun)
                kept = quick.relight(radiance), sun
            else:
                sun, rest = None, light
                if sharp_sun:
                    rest, sun = split_sun(light, rotation)
                radiance = on_texels(self._bake, rest, rotation)
                kept = self._bake.transport.received(radiance), sun
            self._last = (light, *made_from), kept
        return kept

    def _turned(self, light, rotation, sharp_sun):
        """Light on texels, and its sun; an environment is cut into parts once."""
        if not isinstance(light, EnvironmentMap):
            return on_texels(self._bake, light, rotation), None
        key = id(light), sharp_sun
        if key not in self._turning:
            rest, sun = split_sun(light) if sharp_sun else (light, None)
            while len(self._turning) >= _MOST_IMAGES:
                self._turning.pop(next(iter(self._turning)))
            # The environment is kept with it, so that its id stays its own.
            self._turning[key] = light, TurningLight(rest, self._bake.cube_map), sun
        _, turning, sun = self._turning[key]
        sun = sun and replace(sun, rotation=rotation_matrix(rotation))
        return turning.at(rotation), sun


def on_texels(bake, light, rotation=None):
    """(n_directions, 3) float32 of an environment, of 'world', or of light on texels already."""
    expect_offers("bake", bake, ("world", "cube_map"), "what `load` returns")
    if isinstance(light, str):
        expect(light == "world", f"light: expected 'world' or an image, got {light!r}")
        expect(
            bake.world is not None,
            "light 'world': the bake has none, its world was not understood; give an image",
        )
        expect(rotation is None, "rotation: the world's light is fixed; give its image to turn it")
        return bake.world
    if isinstance(light, EnvironmentMap):
        return light.to_cube_map(bake.cube_map, rotation)
    expect(rotation is None, "rotation: turns an environment image, not a light on texels")
    return expect_radiance("light", light, bake.cube_map)
