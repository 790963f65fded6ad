"""`Relighter`: one bake under changing light, keeping what did not change."""

from pathlib import Path

import numpy as np

from prt_core.errors import (
    expect,
    expect_flag,
    expect_kind,
    expect_number,
    expect_offers,
    expect_one_of,
    expect_whole,
)
from prt_core.light import EnvironmentMap
from prt_core.light.environment import BRIGHTEST, expect_radiance, expect_strength
from prt_core.light.images import reads_in_threads
from prt_core.relight.environments import Environments
from prt_core.relight.forms import FormInUse
from prt_core.relight.lamps import LampLight, chosen_lamps
from prt_core.runtime.progress import beside, maybe_beside, run
from prt_core.sphere import rotation_matrix

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

    Attributes
    ----------
    used : str
        "exact" or "compressed": what the last colours were made with.
    why : str
        Why `auto` did not use a compressed form; empty where it did.
    notes : tuple of str
        What is to be said of the image last read (see `read_picture`).
    """

    def __init__(self, bake, caster="auto", transport="auto"):
        # A `Bake`; that module is on a floor above this one.
        parts = "scene", "transport", "make_caster"
        expect_offers("bake", bake, parts, "what `load` returns")
        self.bake, self.transport = bake, expect_one_of("transport", transport, TRANSPORTS)
        expect_kind("caster", caster, str, "the name of one")
        self.used, self.notes = "exact", ()
        self._environments, self._form = Environments(bake), FormInUse(bake)
        self._lamps = LampLight(bake, caster)

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
        strength = expect_number("strength", strength, 0, BRIGHTEST)
        light_strength = expect_number("light_strength", light_strength, 0, BRIGHTEST)
        sharp_sun = expect_flag("sharp_sun", sharp_sun)
        lamp_samples = expect_whole("lamp_samples", lamp_samples, 1, MOST_LAMP_SAMPLES)
        expect_bounces(bounces)
        rotation_matrix(rotation)
        if pace is not None:
            expect_number("pace", pace, above=0)
        chosen = chosen_lamps(self.bake, light, lamps)
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
        light = yield from maybe_beside(apart, "image", self._environments.read, light)
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
            unread, work = pace and not self._form.is_read, (self.transport, bounces)
            quick = yield from maybe_beside(unread, "compressed form", self._form.relighter, *work)
        self.used = "exact" if quick is None else "compressed"
        work = (self._environments.distant, light, rotation, sharp_sun, quick)
        distant, sun = (yield from beside("light", *work)) if pace else work[0](*work[1:])
        chosen += [sun] if sun is not None else []
        parts = yield from self._lamps.steps(chosen, lamp_samples, pace)
        factors = [strength] * len(parts)
        if sun is not None:
            factors[-1] *= light_strength
        sent = None
        if quick is not None:
            sent = distant * np.float32(strength * light_strength)
            if not parts:
                return sent
        elif distant is not None:
            parts, factors = [distant, *parts], [strength * light_strength, *factors]
        work = (self._radiance, parts, factors, bounces)
        radiance = (yield from beside("bounces", *work)) if pace else work[0](*work[1:])
        return radiance if sent is None else radiance + sent

    def compressed(self):
        """The `Compressed` form that would be used, or None: then `why` says why not."""
        return self._form.read()

    @property
    def why(self):
        """Why `auto` did not use a compressed form; empty where it did."""
        return self._form.why

    def _radiance(self, parts, factors, bounces):
        total = np.zeros((self.bake.transport.n_points, 3), np.float32)
        for part, factor in zip(parts, factors, strict=True):
            total += part if factor == 1 else part * np.float32(factor)
        return self.bake.transport.bounce(total, bounces)

    def close(self):
        """Let go of everything."""
        for part in (self._environments, self._lamps, self._form):
            part.close()


def expect_bounces(bounces):
    """Raise `PRTError` unless this is "baked", None (all) or a number of bounces."""
    if bounces is not None and not (isinstance(bounces, str) and bounces == "baked"):
        expect_whole("bounces", bounces, 0)
