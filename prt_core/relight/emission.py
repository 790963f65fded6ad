"""Emitters in one bake: how bright and in which colour each of them shines."""

import numpy as np

from prt_core.errors import PRTError, expect, expect_array, expect_number, shown
from prt_core.light.environment import BRIGHTEST

# Stands for the emitters that are not named.
OTHERS = "*"
_KINDS = "'all', 'none', or a dict of names to a factor, a colour, or (colour, factor)"


def emission_of(value):
    """What a `Lighting` says of emitters, as tuples (name, colour or None, factor) by name.

    Parameters
    ----------
    value : None, str or dict
        None or "all": all shine as the bake has them; "none": none does. A dict has for names of
        emitters, or "*" for all others, a factor; a colour, linear (3,) or "#rrggbb", that takes
        the place of the emitter's own; or both, as (colour, factor) or "#rrggbb:factor".

    Returns
    -------
    tuple

    Raises
    ------
    PRTError
        It is none of these.
    """
    if value is None or (isinstance(value, str) and value == "all"):
        return ()
    if isinstance(value, str) and value == "none":
        return ((OTHERS, None, 0.0),)
    if isinstance(value, tuple) and all(isinstance(v, tuple) and len(v) == 3 for v in value):
        return value  # checked already
    good = isinstance(value, dict) and all(isinstance(name, str) for name in value)
    expect(good, f"emission: expected {_KINDS}, got {shown(value)}")
    return tuple(sorted((name, *_parsed(name, setting)) for name, setting in value.items()))


def _parsed(name, setting):
    """(colour or None, factor) of what is asked of one emitter."""
    what = f"emission: '{name}'"
    if isinstance(setting, str):
        colour, colon, factor = setting.partition(":")
        if not colour.startswith("#"):
            return None, _factor(what, colour if not colon else setting)
        return _hexadecimal(what, colour), _factor(what, factor) if colon else 1.0
    if isinstance(setting, tuple | list) and len(setting) == 2:
        colour, factor = setting
        if isinstance(colour, str):
            colour = _hexadecimal(what, colour)
        return _colour(what, colour), _factor(what, factor)
    if isinstance(setting, tuple | list | np.ndarray):
        return _colour(what, setting), 1.0
    return None, _factor(what, setting)


def _factor(what, value):
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            value = shown(value)
            raise PRTError(
                f"{what}: expected a factor, '#rrggbb' or '#rrggbb:factor', got {value}"
            ) from None
    return expect_number(what, value, 0, BRIGHTEST)


def _colour(what, value):
    if value is None:
        return None
    return tuple(expect_array(f"{what}: colour", value, (3,), np.float64, 0, BRIGHTEST).tolist())


def _hexadecimal(what, text):
    """Linear colour of "#rrggbb", which is sRGB."""
    digits = text.removeprefix("#")
    good = len(digits) == 6 and all(digit in "0123456789abcdefABCDEF" for digit in digits)
    expect(good, f"{what}: expected a colour as '#rrggbb', got {shown(text)}")
    values = np.array([int(digits[i : i + 2], 16) for i in (0, 2, 4)]) / 255
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return tuple(linear.tolist())


class EmittedLight:
    """What the points of one bake receive of its emitters, and send out of their own.

    Parameters
    ----------
    bake : Bake
    """

    def __init__(self, bake):
        self._bake = bake
        self.close()

    def close(self):
        """Let go of what was worked out."""
        self._last = None, None

    def of(self, lighting):
        """What a `Lighting` makes of the emitters.

        Returns
        -------
        received : (n_points, 3) float32
            Irradiance / pi, with as many bounces as the lighting asks for.
        sent : (n_points, 3) float32
            Radiance that points send out of their own.
        None where nothing shines.

        Raises
        ------
        PRTError
            It names an emitter that the bake has not.
        """
        emission = self._bake.emission
        names = () if emission is None else emission.names
        wanted = {name: how for name, *how in lighting.emission}
        rest = wanted.pop(OTHERS, [None, 1.0])
        unknown = [name for name in wanted if name not in names]
        known = f"it has {', '.join(names)}" if names else "nothing in it emits light"
        expect(
            not unknown,
            f"emission: the bake has no emitter {', '.join(map(repr, unknown))}; {known}",
        )
        settings = [wanted.get(name, rest) for name in names]
        if not any(factor > 0 for _, factor in settings):
            return None
        transport = self._bake.transport
        key = lighting.emission, lighting.bounces, transport.bounced_albedo
        if self._last[0] is None or any(
            a is not b and a != b if i < 2 else a is not b
            for i, (a, b) in enumerate(zip(self._last[0], key, strict=True))
        ):
            result = self._received(settings, lighting.bounces), self._sent(settings)
            self._last = key, result
        return self._last[1]

    def _received(self, settings, bounces):
        emission, transport = self._bake.emission, self._bake.transport
        baked = bounces == "baked" or bounces == transport.bounces
        # Albedo that was replaced after the bake bounces otherwise.
        stored = (
            emission.received is not None and baked and transport.bounced_albedo is emission.albedo
        )
        values = emission.received if stored else emission.direct
        total = np.zeros((transport.n_points, 3), np.float32)
        for light, (colour, factor) in zip(values, settings, strict=True):
            if factor > 0:
                own, white = light[:, :3], light[:, 3:]
                shone = own if colour is None else white * np.float32(colour)
                total += shone * np.float32(factor)
        return total if stored else transport.with_bounces(total, bounces)

    def _sent(self, settings):
        points = self._bake.scene.points
        own = points.materials.emission
        # The last row is of points that belong to no emitter, which send out nothing.
        factor = np.array([factor for _, factor in settings] + [0.0], np.float32)[points.emitter]
        sent = own * factor[:, None]
        for index, (colour, factor) in enumerate(settings):
            if colour is not None:
                belongs = points.emitter == index
                value = own[belongs].max(axis=1, keepdims=True)
                sent[belongs] = value * np.float32(colour) * np.float32(factor)
        return sent
