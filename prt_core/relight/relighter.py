"""`Relighter`: one bake under changing light, keeping what did not change."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from prt_core.bake.compress import load_compressed
from prt_core.compress import HaarLighting, IncrementalLighting
from prt_core.errors import (
    PRTError,
    expect,
    expect_all,
    expect_flag,
    expect_kind,
    expect_number,
    expect_offers,
    expect_one_of,
    expect_path,
    expect_whole,
    system_errors,
)
from prt_core.light import (
    BrightPixels,
    EnvironmentMap,
    Lamp,
    TurningLight,
    split_sun,
)
from prt_core.light.environment import BRIGHTEST, expect_radiance, expect_strength
from prt_core.light.images import reads_in_threads
from prt_core.runtime.progress import Pace, beside, maybe_beside, run
from prt_core.sphere import rotation_matrix
from prt_core.transport import lamp_steps

# Images, and lights to be turned, that stay in memory at once.
_MOST_IMAGES = 4
TRANSPORTS = ("auto", "exact", "compressed")
# Shadow rays a point and lamp: beyond, their random numbers alone take a gigabyte.
MOST_LAMP_SAMPLES = 1 << 13


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
    transport : {"auto", "exact", "compressed"}
        What light from far away is multiplied with. `auto`: the compressed form where the bake
        has one that is its own and the bounces are those of the bake, else the bake itself.
    progressive : bool
        Each light adds what changed most since the one before, in a compressed form by Haar
        lighting (see `IncrementalLighting`): colours then depend on what was asked before, and
        come nearer while the light moves little.

    Attributes
    ----------
    used : str
        "exact" or "compressed": what the last colours were made with.
    why : str
        Why `auto` did not use a compressed form; empty where it did.
    notes : tuple of str
        What is to be said of the image last read (see `read_picture`).
    """

    def __init__(self, bake, caster="auto", transport="auto", progressive=False):
        # A `Bake`; that module knows no relighter, and this one need not know it.
        parts = "scene", "transport", "make_caster"
        expect_offers("bake", bake, parts, "what `load` returns")
        self.bake, self.transport = bake, expect_one_of("transport", transport, TRANSPORTS)
        expect_kind("caster", caster, str, "the name of one")
        self.progressive = expect_flag("progressive", progressive)
        self.used, self.why, self.notes = "exact", "", ()
        self._caster_name, self._caster = caster, None
        self._images, self._turning = {}, {}
        self._environment = (None, None)
        self._lamps = {}
        self._form = None

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
        of="points",
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
        of : {"points", "image"}
            What is shown: all points, or the image that was baked. A compressed form is of one.

        Returns
        -------
        (n_points, 3) or (height, width, 3) float32
            Linear Rec.709 radiance.
        """
        expect_one_of("of", of, ("points", "image"))
        image = self.bake.scene.image
        expect(
            of == "points" or image is not None,
            "image: this bake holds none; bake with --camera-pixels or --geometry-image",
        )
        strength = expect_number("strength", strength, 0, BRIGHTEST)
        light_strength = expect_number("light_strength", light_strength, 0, BRIGHTEST)
        sharp_sun = expect_flag("sharp_sun", sharp_sun)
        lamp_samples = expect_whole("lamp_samples", lamp_samples, 1, MOST_LAMP_SAMPLES)
        expect_bounces(bounces)
        rotation_matrix(rotation)
        if pace is not None:
            expect_number("pace", pace, above=0)
        chosen = self._chosen_lamps(light, lamps)
        # No lamps in a list is an answer; not to ask for any is none.
        expect(
            light is not None or chosen or isinstance(lamps, list | tuple),
            "light: give an environment image, 'world', or ask for the lamps",
        )
        expect(
            light is not None or rotation is None,
            "rotation: turns an environment image; there is none",
        )
        apart = pace and isinstance(light, str | Path) and reads_in_threads(light)
        light = yield from maybe_beside(apart, "image", self._read, light)
        if sharp_sun:
            expect(
                isinstance(light, EnvironmentMap),
                "sharp_sun: needs an environment image, not a light that is on texels already",
            )
        if isinstance(light, EnvironmentMap):
            expect_strength(light.name, light.pixels, strength * light_strength)
        elif light is not None and not isinstance(light, str):
            texels = expect_radiance("light", light, self.bake.cube_map)
            expect_strength("light", texels, strength * light_strength)
        self.notes = getattr(light, "notes", ())
        quick = None
        if light is not None and self.transport != "exact":
            unread = pace and self._form is None
            quick = yield from maybe_beside(unread, "compressed form", self._quick, bounces, of)
        self.used = "exact" if quick is None else "compressed"
        work = (self._distant, light, rotation, sharp_sun, quick)
        distant, sun = (yield from beside("light", *work)) if pace else work[0](*work[1:])
        chosen += [sun] if sun is not None else []
        parts = yield from self._lamp_parts(chosen, lamp_samples, pace)
        factors = [strength] * len(parts)
        if sun is not None:
            factors[-1] *= light_strength
        sent = None
        if quick is not None:
            sent = distant * np.float32(strength * light_strength)
            sent = sent if of == "points" else sent.reshape(image.height, image.width, -1)
            if not parts:
                return sent
        elif distant is not None:
            parts, factors = [distant, *parts], [strength * light_strength, *factors]
        work = (self._radiance, parts, factors, bounces)
        radiance = (yield from beside("bounces", *work)) if pace else work[0](*work[1:])
        radiance = radiance if of == "points" else self.bake.image(radiance)
        return radiance if sent is None else radiance + sent

    def compressed(self):
        """The `Compressed` form that would be used, or None: then `why` says why not."""
        if self._form is None:
            found, self.why = load_compressed(self.bake)
            quick = None
            if found is not None:
                bits = self.bake.transport if found.of == "points" else None
                quick = self._incremental(found) if self.progressive else found.relighter(bits)
            self._form = found, quick, self.bake.transport.albedo
        found, _, albedo = self._form
        if found is not None and albedo is not self.bake.transport.albedo:
            # Materials may be replaced after the bake: then the form is of another one.
            self._form = None
            return self.compressed()
        return found

    @staticmethod
    def _incremental(form):
        expect(
            isinstance(form.model, HaarLighting),
            f"progressive: adds to a compressed form by haar, this one is by {form.method}; "
            "run 'prt compress --method haar' first",
        )
        return IncrementalLighting(form.model)

    def _quick(self, bounces, of):
        """What relights fast; None where the exact way is to be taken."""
        try:
            found = self.compressed()
        except PRTError as error:
            if self.transport == "compressed":
                raise
            found, self.why = None, str(error)
            self._form = None, None, self.bake.transport.albedo
        applies = bounces in ("baked", self.bake.transport.bounces)
        if found is not None and not applies:
            found, self.why = None, f"it holds the bounces of the bake, not {bounces}"
        if found is not None and found.of != of:
            found, self.why = None, f"it is of the {found.of}, not of the {of}"
        expect(
            found is not None or self.transport != "compressed",
            f"transport: the compressed form cannot be used: {self.why}",
        )
        if found is None:
            return None
        self.why = ""
        return self._form[1]

    def _chosen_lamps(self, light, lamps):
        if not isinstance(lamps, bool | np.bool_):
            return expect_all("lamps", lamps, Lamp | BrightPixels, "lamps, True or False")
        if not lamps:
            return []
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
        path = expect_path("light", light)
        with system_errors(path):
            stamp = path.stat().st_mtime_ns if path.is_file() else None
        if (path, stamp) not in self._images:
            while len(self._images) >= _MOST_IMAGES:
                self._images.pop(next(iter(self._images)))
            self._images[path, stamp] = EnvironmentMap.read(path)
        return self._images[path, stamp]

    def _distant(self, light, rotation, sharp_sun, quick):
        """Of light from far away at strength 1, and the sun left out of it.

        What every point receives; with a compressed form, what it sends out.
        """
        if light is None:
            return None, None
        key, kept = self._environment
        turned = rotation_matrix(rotation).tobytes()
        made_from = (turned, sharp_sun, quick)
        same = key is not None and key[0] is light and key[1:] == made_from
        if not same or not isinstance(light, EnvironmentMap | str):
            if quick is not None:
                radiance, sun = self._turned(light, rotation, sharp_sun)
                kept = quick.relight(radiance), sun
            else:
                sun, rest = None, light
                if sharp_sun:
                    rest, sun = split_sun(light, rotation)
                radiance = on_texels(self.bake, rest, rotation)
                kept = self.bake.transport.received(radiance), sun
            self._environment = (light, *made_from), kept
        return kept

    def _turned(self, light, rotation, sharp_sun):
        """Light on texels, and its sun; an environment is cut into parts once."""
        if not isinstance(light, EnvironmentMap):
            return on_texels(self.bake, light, rotation), None
        key = id(light), sharp_sun
        if key not in self._turning:
            rest, sun = split_sun(light) if sharp_sun else (light, None)
            while len(self._turning) >= _MOST_IMAGES:
                self._turning.pop(next(iter(self._turning)))
            # The environment is kept with it, so that its id stays its own.
            self._turning[key] = light, TurningLight(rest, self.bake.cube_map), sun
        _, turning, sun = self._turning[key]
        sun = sun and replace(sun, rotation=rotation_matrix(rotation))
        return turning.at(rotation), sun

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
        self._turning, self._form = {}, None


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


def expect_bounces(bounces):
    """Raise `PRTError` unless this is "baked", None (all) or a number of bounces."""
    if bounces is not None and not (isinstance(bounces, str) and bounces == "baked"):
        expect_whole("bounces", bounces, 0)


def lamp_signature(lamp):
    """What a lamp's light depends on, as something that can be compared."""
    values = (getattr(lamp, field.name) for field in fields(lamp) if field.name != "name")
    return tuple(v.tobytes() if isinstance(v, np.ndarray) else v for v in values)
