"""`Lighting`: the light that a bake is asked under, as one value.

Calls, the command line and the add-on's panel fill one in; `Relighter` answers it. What is wrong
with it in itself is said when it is made, what is wrong with it for a bake when it is relit.
"""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from prt_core.errors import (
    expect,
    expect_all,
    expect_flag,
    expect_number,
    expect_numbers,
    expect_path,
    expect_whole,
)
from prt_core.light import BrightPixels, EnvironmentMap, Lamp
from prt_core.light.environment import BRIGHTEST
from prt_core.relight.emission import emission_of
from prt_core.relight.lamps import lamp_signature
from prt_core.sphere import rotation_matrix

# Shadow rays a point and lamp: beyond, their random numbers alone take a gigabyte.
MOST_LAMP_SAMPLES = 1 << 13
# Stops beyond which float32 overflows or holds nothing any more.
MOST_STOPS = 64


@dataclass(frozen=True, eq=False)
class Lighting:
    """What shines on a baked scene, and how much of its way is followed.

    Parameters
    ----------
    environment : str, Path, EnvironmentMap or (n_directions, 3) array, optional
        Light from far away: an equirectangular .exr or .hdr image, radiance on the directions of
        the bake, or "world", the light of the baked scene's own world.
    rotation : float, (3,) or (3, 3), optional
        Of an image: degrees about z, Euler angles in degrees, or a matrix (see `rotation_matrix`).
    strength : float
        Factor on the light.
    sharp_sun : bool
        Take what is far brighter than the rest out of the image and cast its shadow rays: shadows
        as sharp as the image, not as the cube map's texels.
    lamps : bool or sequence of Lamp
        True: those of the baked scene. Their shadow rays are cast when relighting.
    lamp_strength : float, optional
        Factor on the lamps; default: `strength`.
    lamp_samples : int
        Shadow rays a point and lamp, or sharp sun.
    bounces : int or None
        How often light is followed from surface to surface: 0 is direct light, None all bounces
        that matter. Default: "baked", as the bake was made.
    exposure : float
        Stops: a factor of 2^stops on the colours that come out.
    emission : str or dict, optional
        How materials that emit light shine, which they do by default, as in a render: "all",
        "none", or a dict that has for the names of some, or "*" for all others, a factor (0 is
        off); a colour in place of their own, linear (3,) or "#rrggbb"; or both, as
        (colour, factor) or "#rrggbb:factor". A colour is as bright as the emitter's largest
        channel.

    Raises
    ------
    PRTError
        Nothing shines, or something of it is wrong.
    """

    environment: object = None
    rotation: object = None
    strength: float = 1.0
    sharp_sun: bool = False
    lamps: object = False
    lamp_strength: float | None = None
    lamp_samples: int = 256
    bounces: object = "baked"
    exposure: float = 0.0
    emission: object = None

    def __post_init__(self):
        checked = {
            "environment": _environment(self.environment),
            "strength": expect_number("strength", self.strength, 0, BRIGHTEST),
            "sharp_sun": expect_flag("sharp_sun", self.sharp_sun),
            "lamps": _lamps(self.lamps),
            "lamp_samples": expect_whole("lamp_samples", self.lamp_samples, 1, MOST_LAMP_SAMPLES),
            "exposure": expect_number("exposure", self.exposure, -MOST_STOPS, MOST_STOPS),
        }
        if self.lamp_strength is not None:
            of_lamps = expect_number("lamp_strength", self.lamp_strength, 0, BRIGHTEST)
            checked["lamp_strength"] = of_lamps
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        if self.bounces is not None and not _is_text(self.bounces, "baked"):
            expect_whole("bounces", self.bounces, 0)
        rotation_matrix(self.rotation)
        # No lamps in a list is an answer; not to ask for any is none.
        expect(
            self.environment is not None or self.lamps is not False or self.emission is not None,
            "light: give an environment image, 'world', or ask for the lamps or the emission",
        )
        object.__setattr__(self, "emission", emission_of(self.emission))
        self._expect_turnable()
        expect(
            not self.sharp_sun or self.is_image,
            "sharp_sun: needs an environment image, not a light that is on texels already",
        )

    def _expect_turnable(self):
        if self.rotation is None or self.is_image:
            return
        expect(self.environment is not None, "rotation: turns an environment image; there is none")
        expect(not self.is_world, "rotation: the world's light is fixed; give its image to turn it")
        expect(False, "rotation: turns an environment image, not a light on texels")

    @property
    def is_world(self):
        """Whether the environment is the light of the baked scene's own world."""
        return _is_text(self.environment, "world")

    @property
    def is_image(self):
        """Whether the environment is an image, read or not: only that can be turned."""
        return isinstance(self.environment, Path | EnvironmentMap)

    @property
    def matrix(self):
        """(3, 3) float64 that turns directions of the environment."""
        return rotation_matrix(self.rotation)

    @property
    def lamp_factor(self):
        """The factor on the lamps."""
        return self.strength if self.lamp_strength is None else self.lamp_strength

    @property
    def exposure_factor(self):
        """The factor on the colours that come out."""
        return 2.0**self.exposure

    @property
    def key(self):
        """What the colours depend on, as something that can be compared and lasts as long."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        light = values["environment"]
        if isinstance(light, Path):
            values["environment"] = light, light.stat().st_mtime_ns if light.is_file() else 0
        elif light is not None and not self.is_world:
            values["environment"] = id(light)
        values["rotation"] = self.matrix.tobytes()
        lamps = values["lamps"]
        if not isinstance(lamps, bool):
            values["lamps"] = tuple(lamp_signature(lamp) for lamp in lamps)
            if not self.sharp_sun and all(lamp.is_small for lamp in lamps):
                # One shadow ray shows all of a lamp without size.
                values["lamp_samples"] = 1
        return tuple(values.items())


def lighting_of(light=None, **keywords):
    """The `Lighting` that a call asks for by keywords.

    Parameters
    ----------
    light : Lighting, or what its environment may be, optional
    **keywords
        The other fields of `Lighting`, by their names.

    Returns
    -------
    Lighting

    Raises
    ------
    PRTError
        Both are given, or there is no such field.
    """
    known = [field.name for field in fields(Lighting) if field.name != "environment"]
    unknown = sorted(set(keywords) - set(known))
    expect(
        not unknown,
        f"{', '.join(unknown)}: there is no such keyword; there are {', '.join(known)}",
    )
    if not isinstance(light, Lighting):
        return Lighting(light, **keywords)
    given = ", ".join(keywords)
    expect(not keywords, f"{given}: belongs into the Lighting that is given; use replace()")
    return light


def _environment(light):
    if light is None or isinstance(light, EnvironmentMap) or _is_text(light, "world"):
        return light
    if isinstance(light, str | Path):
        return expect_path("light", light)
    # How many values there are to be only a bake knows.
    expect_numbers("light", light)
    return light


def _lamps(lamps):
    if isinstance(lamps, bool | np.bool_):
        return bool(lamps)
    return tuple(expect_all("lamps", lamps, Lamp | BrightPixels, "lamps, True or False"))


def _is_text(value, text):
    """Whether `value` is this text: arrays are compared by their elements."""
    return isinstance(value, str) and value == text
