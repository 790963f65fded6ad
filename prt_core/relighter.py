"""`Relighter`: one bake under changing light, keeping what did not change."""

from dataclasses import fields
from pathlib import Path

import numpy as np

from prt_core.errors import expect, expect_array
from prt_core.light import EnvironmentMap, rotation_matrix, split_sun
from prt_core.light.images import reads_in_threads
from prt_core.progress import Pace, beside, maybe_beside, run
from prt_core.transport import lamp_steps

# Images that stay in memory at once.
_MOST_IMAGES = 4


class Relighter:
    """Relights one bake again and again: what an animation, a slider or a game loop needs.

    The environment on the cube map, its received light and each lamp's received light are kept
    until what they depend on changes; a new strength, exposure or bounce count costs only the
    bounces. The colours are those of `relight`, bit by bit, whatever was asked before.

    Parameters
    ----------
    bake : Bake
    caster : str
        For the shadow rays of lamps and sharp suns; made when first needed.
    """

    def __init__(self, bake, caster="auto"):
        self.bake = bake
        self._caster_name, self._caster = caster, None
        self._images = {}
        self._environment = (None, None)
        self._lamps = {}

    def relight(self, light=None, **options):
        """(n_points, 3) float32 radiance; see `steps`."""
        return run(self.steps(light, **options))

    def steps(
        self,
        light=None,
        rotation=None,
        strength=1.0,
        sharp_sun=False,
        lamps=False,
        lamp_samples=256,
        bounces="baked",
        light_strength=1.0,
        pace=None,
    ):
        """Relight, as a generator of `Progress`.

        Parameters
        ----------
        light, rotation, strength, sharp_sun, lamps, lamp_samples, bounces
            As `relight` takes them.
        light_strength : float
            Another factor, on `light` alone.
        pace : float, optional
            Seconds a step may take; then the arithmetic runs beside the caller, in a thread.

        Returns
        -------
        (n_points, 3) float32
            Linear Rec.709 radiance of all points.
        """
        expect(
            light is not None or lamps is not False,
            "light: give an environment image, 'world', or ask for the lamps",
        )
        for factor in (strength, light_strength):
            expect(
                np.isfinite(factor) and factor >= 0,
                f"strength: expected a finite number >= 0, got {factor}",
            )
        chosen = self._chosen_lamps(light, lamps)
        apart = pace and isinstance(light, str | Path) and reads_in_threads(light)
        light = yield from maybe_beside(apart, "image", self._read, light)
        if sharp_sun:
            expect(
                isinstance(light, EnvironmentMap),
                "sharp_sun: needs an environment image, not a light that is on texels already",
            )
        work = (self._received, light, rotation, sharp_sun)
        received, sun = (yield from beside("light", *work)) if pace else work[0](*work[1:])
        chosen += [sun] if sun is not None else []
        parts = yield from self._lamp_parts(chosen, lamp_samples, pace)
        factors = [strength] * len(parts)
        if sun is not None:
            factors[-1] *= light_strength
        if received is not None:
            parts, factors = [received, *parts], [strength * light_strength, *factors]
        work = (self._radiance, parts, factors, bounces)
        return (yield from beside("bounces", *work)) if pace else work[0](*work[1:])

    def _chosen_lamps(self, light, lamps):
        if lamps is not True:
            return list(lamps or [])
        found = list(self.bake.lamps)
        expect(found, "lamps: the baked scene had no lamps that render")
        if isinstance(light, str) and light == "world":
            # The world's light holds the suns already, on its texels.
            found = [lamp for lamp in found if lamp.kind != "sun"]
        return found

    def _read(self, light):
        """An `EnvironmentMap` where `light` is the path of an image, else `light` as it is."""
        if not isinstance(light, str | Path) or light == "world":
            return light
        path = Path(light)
        stamp = path.stat().st_mtime_ns if path.is_file() else None
        if (path, stamp) not in self._images:
            while len(self._images) >= _MOST_IMAGES:
                self._images.pop(next(iter(self._images)))
            self._images[path, stamp] = EnvironmentMap.read(path)
        return self._images[path, stamp]

    def _received(self, light, rotation, sharp_sun):
        """Light from far away at strength 1, received by every point; and the sun left out."""
        if light is None:
            return None, None
        key, kept = self._environment
        turned = rotation_matrix(rotation).tobytes()
        same = key is not None and key[0] is light and key[1:] == (turned, sharp_sun)
        if not same or not isinstance(light, EnvironmentMap | str):
            sun, rest = None, light
            if sharp_sun:
                rest, sun = split_sun(light, rotation)
            radiance = on_texels(self.bake, rest, rotation)
            kept = self.bake.transport.received(radiance), sun
            self._environment = (light, turned, sharp_sun), kept
        return kept

    def _lamp_parts(self, lamps, n_samples, pace):
        parts = {}
        for index, lamp in enumerate(lamps):
            key = index, n_samples, lamp_signature(lamp)
            if key not in parts and key in self._lamps:
                parts[key] = self._lamps[key]
            if key not in parts:
                pacing = Pace(pace, 1 << 15)
                parts[key] = yield from lamp_steps(
                    self.bake.scene, self._rays(), lamp, n_samples, (0, index), pacing
                )
        # What was not asked for this time is forgotten; a draft's rays do not push out the rest.
        kept = [key for key in self._lamps if key[1] != n_samples]
        self._lamps = {**{key: self._lamps[key] for key in kept[-len(lamps) :]}, **parts}
        return list(parts.values())

    def _rays(self):
        if self._caster is None:
            self._caster = self.bake.make_caster(self._caster_name)
        return self._caster

    def _radiance(self, parts, factors, bounces):
        total = np.zeros((self.bake.transport.n_points, 3), np.float32)
        for part, factor in zip(parts, factors, strict=True):
            total += part if factor == 1 else part * np.float32(factor)
        return self.bake.transport.bounce(total, bounces)

    def close(self):
        """Let go of everything."""
        if self._caster is not None:
            self._caster.close()
        self._caster = None
        self._images, self._lamps, self._environment = {}, {}, (None, None)


def on_texels(bake, light, rotation=None):
    """(n_directions, 3) float32 of an environment, of 'world', or of light on texels already."""
    if isinstance(light, str):
        expect(
            bake.world is not None,
            "light 'world': the bake has none, its world was not understood; give an image",
        )
        expect(rotation is None, "rotation: the world's light is fixed; give its image to turn it")
        return bake.world
    if isinstance(light, EnvironmentMap):
        return light.to_cube_map(bake.cube_map, rotation)
    expect(rotation is None, "rotation: turns an environment image, not a light on texels")
    return expect_array("light", light, (bake.cube_map.n_directions, 3), np.float32)


def lamp_signature(lamp):
    """What a lamp's light depends on, as something that can be compared."""
    values = (getattr(lamp, field.name) for field in fields(lamp) if field.name != "name")
    return tuple(v.tobytes() if isinstance(v, np.ndarray) else v for v in values)
