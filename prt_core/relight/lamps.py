"""Lamps in one bake: which are meant, and what points receive of each of them."""

from dataclasses import dataclass, fields

import numpy as np

from prt_core.errors import expect
from prt_core.light import BrightPixels, Lamp
from prt_core.runtime.progress import Pace
from prt_core.transport import blocking_caster, lamp_steps
from prt_core.transport.lamp_cells import LampCells, SeenCells, cells_along


@dataclass(frozen=True)
class LitLamp:
    """A lamp, and what points have of it.

    Attributes
    ----------
    lamp : Lamp or BrightPixels
    received : (n_points, 3) float32
        Irradiance / pi.
    seen : SeenCells, optional
        Which parts of the lamp points see; all of it, or nothing: None.
    """

    lamp: Lamp | BrightPixels
    received: np.ndarray
    seen: SeenCells | None = None

    def seen_at(self, points, weights):
        """A function of the numbers of places between points, for `highlights`, or None.

        Parameters
        ----------
        points : (k, m) int
        weights : (k, m) float32
        """
        if self.seen is None:
            return None
        return lambda some: self.seen.between(points[some], weights[some])


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
        self._casters, self._kept = {}, {}

    def close(self):
        """Let go of everything."""
        for caster in self._casters.values():
            caster.close()
        self._casters, self._kept = {}, {}

    def replace(self, bake):
        """See `Relighter.replace`."""
        old, new = self._bake.scene, bake.scene
        if new.points is not old.points:
            self._kept = {}
        if new.triangles is not old.triangles:
            self.close()
        self._bake = bake

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
        parts, scene = {}, self._bake.scene
        self._forget_casters(lamps)
        for index, lamp in enumerate(lamps):
            key = self._key(index, lamp, n_samples)
            if key not in parts and key in self._kept:
                parts[key] = self._kept[key]
            if key not in parts:
                pacing = Pace(pace, 1 << 15)
                cells = LampCells(self._glossy(), key[2]) if key[2] else None
                received = yield from lamp_steps(
                    scene, self._rays(lamp), lamp, n_samples, (0, index), pacing, cells=cells
                )
                parts[key] = received, None if cells is None else cells.seen()
        # What was not asked for this time is forgotten; a draft's rays do not push out the rest.
        kept = [key for key in self._kept if key[1] != n_samples]
        self._kept = {**{key: self._kept[key] for key in kept[-len(lamps) :]}, **parts}
        return [received for received, _ in parts.values()]

    def has(self, lamps, n_samples):
        """Whether what points receive of these lamps is known, of so many shadow rays each."""
        return all(
            self._key(index, lamp, n_samples) in self._kept for index, lamp in enumerate(lamps)
        )

    def shown(self, lamps, n_samples, received):
        """`LitLamp` of each of the lamps of the last `steps` that glossy surfaces show.

        Parameters
        ----------
        lamps, n_samples
            As they were asked for.
        received : sequence of (n_points, 3) float32
            What `steps` gave, times how strong they are.
        """
        keys = [self._key(index, lamp, n_samples) for index, lamp in enumerate(lamps)]
        return [
            LitLamp(lamp, light, self._kept[key][1])
            for lamp, light, key in zip(lamps, received, keys, strict=True)
            if lamp.highlights
        ]

    def _key(self, index, lamp, n_samples):
        """What the light of a lamp is kept by; the third of it are cells that gloss asks for."""
        side = cells_along(lamp, n_samples) if self._bake.reflections else 0
        return index, n_samples, side, lamp_signature(lamp)

    def _glossy(self):
        """(n_points,) bool: which points have reflections."""
        glossy = np.zeros(len(self._bake.scene.points), bool)
        for part in self._bake.reflections:
            glossy[part.points] = True
        return glossy

    def _rays(self, lamp):
        """The caster over what is in the lamp's way, one for all lamps that share it."""
        key = self._blocking(lamp)
        if key not in self._casters:
            caster = blocking_caster(self._bake.scene, lamp, self._name)
            if caster is None:
                return None
            self._casters[key] = caster
        return self._casters[key]

    def _blocking(self, lamp):
        """Which objects are in the lamp's way, as something to compare; all of them: None."""
        if lamp.blockers is None:
            return None if lamp.casts_shadow else b""
        blocking = self._bake.scene.objects_named(lamp.blockers)
        return None if blocking.all() else blocking.tobytes()

    def _forget_casters(self, lamps):
        """Let go of casters over some of the objects that no lamp needs any more."""
        needed = {None, *map(self._blocking, lamps)}
        for key in [key for key in self._casters if key not in needed]:
            self._casters.pop(key).close()


def chosen_lamps(bake, lighting):
    """A list of the lamps that a `Lighting` means: its own, or those of the baked scene.

    The suns of the baked world's sky come last, with the world.
    """
    lamps = [] if isinstance(lighting.lamps, bool) else list(lighting.lamps)
    if lighting.lamps is True:
        lamps = [lamp for lamp in bake.lamps if not lamp.of_world]
        expect(lamps, "lamps: the baked scene had no lamps that render")
        # The world's light holds the suns already, on its texels.
        lamps = [lamp for lamp in lamps if not (lighting.is_world and lamp.is_on_texels)]
    return lamps + world_suns(bake, lighting)


def world_suns(bake, lighting):
    """A list of the suns that shine with the baked world, where a `Lighting` asks for it."""
    return [lamp for lamp in bake.lamps if lamp.of_world] if lighting.is_world else []


def lamp_signature(lamp):
    """What a lamp's light depends on, as something that can be compared."""
    values = (getattr(lamp, field.name) for field in fields(lamp) if field.name != "name")
    return tuple(v.tobytes() if isinstance(v, np.ndarray) else v for v in values)
