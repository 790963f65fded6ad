"""Lamps in one bake: which are meant, and what points receive of each of them."""

from dataclasses import fields

import numpy as np

from prt_core.errors import expect
from prt_core.runtime.progress import Pace
from prt_core.transport import lamp_steps


class LampLight:
    """What the points of one bake receive of lamps.

    Parameters
    ----------
    bake : Bake
    caster : str
        For the shadow rays; made when first needed.
    """

    def __init__(self, bake, caster):
        self._bake, self._name = bake, caster
        self._caster, self._kept = None, {}

    def close(self):
        """Let go of everything."""
        if self._caster is not None:
            self._caster.close()
        self._caster, self._kept = None, {}

    def steps(self, lamps, n_samples, pace=None):
        """A list of (n_points, 3) float32, one for each lamp; a generator of `Progress`.

        Parameters
        ----------
        lamps : sequence of Lamp or BrightPixels
        n_samples : int
            Shadow rays a point and lamp.
        pace : float, optional
            Seconds a step may take.
        """
        parts = {}
        for index, lamp in enumerate(lamps):
            key = index, n_samples, lamp_signature(lamp)
            if key not in parts and key in self._kept:
                parts[key] = self._kept[key]
            if key not in parts:
                pacing = Pace(pace, 1 << 15)
                parts[key] = yield from lamp_steps(
                    self._bake.scene, self._rays(), lamp, n_samples, (0, index), pacing
                )
        # What was not asked for this time is forgotten; a draft's rays do not push out the rest.
        kept = [key for key in self._kept if key[1] != n_samples]
        self._kept = {**{key: self._kept[key] for key in kept[-len(lamps) :]}, **parts}
        return list(parts.values())

    def _rays(self):
        if self._caster is None:
            self._caster = self._bake.make_caster(self._name, "shadow")
        return self._caster


def chosen_lamps(bake, lighting):
    """A list of the lamps that a `Lighting` means: its own, or those of the baked scene."""
    if not isinstance(lighting.lamps, bool):
        return list(lighting.lamps)
    if not lighting.lamps:
        return []
    expect(bake.lamps, "lamps: the baked scene had no lamps that render")
    # The world's light holds the suns already, on its texels.
    return [lamp for lamp in bake.lamps if not (lighting.is_world and lamp.kind == "sun")]


def lamp_signature(lamp):
    """What a lamp's light depends on, as something that can be compared."""
    values = (getattr(lamp, field.name) for field in fields(lamp) if field.name != "name")
    return tuple(v.tobytes() if isinstance(v, np.ndarray) else v for v in values)
