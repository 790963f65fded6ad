"""Several lights of one bake at once: day, night and dusk, each with a weight.

Transport is linear in light, so radiances add. What a light gives at weight 1 is kept until the
light changes, and a slider of weights costs a sum.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_all, expect_kind, expect_number, shown
from prt_core.evaluate.view import CameraRays
from prt_core.light.environment import BRIGHTEST
from prt_core.relight.lighting import Lighting
from prt_core.relight.relighter import Relighter
from prt_core.runtime.progress import run


@dataclass(frozen=True)
class WeightedLight:
    """One light of a blend.

    Parameters
    ----------
    name : str
        What of it is kept is kept by this name.
    lighting : Lighting
    weight : float
        Factor on its colours, at least 0.

    Raises
    ------
    PRTError
        Something of it is wrong.
    """

    name: str
    lighting: Lighting
    weight: float = 1.0

    def __post_init__(self):
        expect(
            isinstance(self.name, str), f"light: expected a name as a text, got {shown(self.name)}"
        )
        expect_kind("lighting", self.lighting, Lighting)
        expect_number("weight", self.weight, 0, BRIGHTEST)

    @property
    def key(self):
        """What its colours depend on, as something that can be compared."""
        return self.name, self.weight, *self.lighting.key


class LightBlend:
    """Relights one bake under sums of lights; each light has a `Relighter` of its own.

    Parameters
    ----------
    bake : Bake
    caster, form : str
        See `Relighter`.

    Attributes
    ----------
    form : str
        Of all from now on.
    received : (n_points, 3) float32
        The sum of what points receive (see `Relighter.received`), None before there was any.
    """

    def __init__(self, bake, caster="auto", form="auto"):
        self._bake, self._caster, self.form = bake, caster, form
        self._relighters, self._kept, self._lit, self.received = {}, {}, {}, None
        self.relighter("")

    def relighter(self, name):
        """The `Relighter` of a light; one is made where it has none.

        Parameters
        ----------
        name : str
        """
        if name not in self._relighters:
            self._relighters[name] = Relighter(self._bake, self._caster, self.form)
        return self._relighters[name]

    def radiance(self, lights, *, view=None):
        """(n_points, 3) float32 radiance under the sum of lights.

        Parameters
        ----------
        lights : sequence of WeightedLight
        view : View, optional
            See `Relighter.steps`.
        """
        return run(self.steps(lights, view=view))

    def map_views_steps(self, lights, pace=None):
        """Make maps of views under each light that shines and is known, for views to come.

        See `Relighter.map_views_steps`.

        Parameters
        ----------
        lights : sequence of WeightedLight
        pace : float, optional
        """
        for relighter in self._shining(lights):
            yield from relighter.map_views_steps(pace)

    def maps_views(self, lights):
        """Whether there is a map of views of all lights that shine and are known."""
        return all(relighter.maps_views for relighter in self._shining(lights))

    def _shining(self, lights):
        relighters = [self.relighter(light.name) for light in lights if light.weight > 0]
        return [relighter for relighter in relighters if relighter.lit is not None]

    def steps(self, lights, pace=None, view=None, every=1, mapped=False):
        """Relight under the sum of lights, as a generator of `Progress`.

        Parameters
        ----------
        lights : sequence of WeightedLight
            Those of weight 0 cost nothing; of none at all everything is black.
        pace, view
            See `Relighter.steps`.
        every, mapped
            See `Relighter.view_steps`; they count where the light is known.

        Returns
        -------
        (n_points, 3) float32
            Linear Rec.709 radiance.
        """
        lights = expect_all("lights", lights, WeightedLight, "WeightedLight values")
        names = [light.name for light in lights]
        twice = [name for name in names if names.count(name) > 1]
        expect(not twice, f"lights: two are called '{twice and twice[0]}'; give each its own name")
        self._forget_all_but(names)
        shining = [light for light in lights if light.weight > 0]
        if [light.weight for light in shining] == [1]:
            # As it is: colours of one light are those of its relighter, bit by bit.
            radiance, self.received = yield from self._one(shining[0], pace, view, every, mapped)
            return radiance
        shape = self._bake.transport.n_points, 3
        radiance, received = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        for light in shining:
            one = yield from self._one(light, pace, view, every, mapped)
            for total, part in zip((radiance, received), one, strict=True):
                total += part * np.float32(light.weight)
        self.received = received
        return radiance

    def _one(self, light, pace, view, every, mapped):
        """Radiance and received light of one light at weight 1."""
        lighting, relighter = light.lighting, self.relighter(light.name)
        relighter.form, key = self.form, (self.form, lighting.key)
        known = view is not None and self._knows(light.name, key)
        kept = self._kept.get(light.name)
        how = (every, mapped) if known else (1, False)
        asked = key, None if view is None else (id(view), *how)
        if kept is not None and kept[0] == asked and _lasts(lighting):
            return kept[1]
        if known:
            radiance = yield from relighter.view_steps(view, pace, every, mapped)
        else:
            radiance = yield from relighter.steps(lighting, pace, view=view)
            self._lit[light.name] = key, relighter.lit
        # The light and the view are kept with it, so that their ids stay their own.
        self._kept[light.name] = asked, (radiance, relighter.received), lighting, view
        return self._kept[light.name][1]

    def _knows(self, name, key):
        lit = self.relighter(name).lit
        known, of = self._lit.get(name, (None, None))
        return lit is not None and of is lit and known == key

    def picture(self, rays, lights):
        """What a camera sees, with gloss of each pixel (see `Relighter.picture`).

        Parameters
        ----------
        rays : CameraRays
        lights : sequence of WeightedLight

        Returns
        -------
        (height, width, 3) float32
            Linear Rec.709 radiance; black where nothing shines.
        """
        lights = expect_all("lights", lights, WeightedLight, "WeightedLight values")
        expect_kind("rays", rays, CameraRays)
        total = np.zeros((rays.height, rays.width, 3), np.float32)
        for light in lights:
            if light.weight > 0:
                relighter = self.relighter(light.name)
                relighter.form = self.form
                total += relighter.picture(rays, light.lighting) * np.float32(light.weight)
        return total

    def has_light(self, lights):
        """Whether another view under these lights is only a matter of lobes.

        Parameters
        ----------
        lights : sequence of WeightedLight
        """
        shining = [light for light in lights if light.weight > 0]
        return bool(shining) and all(
            self._knows(light.name, (self.form, light.lighting.key)) for light in shining
        )

    def has_lamps(self, lights):
        """Whether no lamp of these lights needs shadow rays (see `Relighter.has_lamps`).

        Parameters
        ----------
        lights : sequence of WeightedLight
        """
        return all(
            self.relighter(light.name).has_lamps(light.lighting)
            for light in lights
            if light.weight > 0
        )

    def sky(self, lights):
        """What is seen behind the scene: the sum of the lights' images (see `Relighter.sky`).

        Parameters
        ----------
        lights : sequence of WeightedLight
        """
        skies = [
            (self.relighter(light.name).sky(light.lighting), light.weight)
            for light in lights
            if light.weight > 0
        ]
        scaled = [sky.scaled(weight) for sky, weight in skies if sky is not None]
        return sum(scaled[1:], scaled[0]) if scaled else None

    def replace(self, bake):
        """Relight another state of the bake, as it comes nearer (see `Relighter.replace`).

        Parameters
        ----------
        bake : Bake
        """
        if bake is self._bake:
            return
        self._bake, self._kept, self._lit = bake, {}, {}
        for relighter in self._relighters.values():
            relighter.replace(bake)

    @property
    def used(self):
        """ "compressed" where all that shone last did by a compressed form, else "exact"."""
        used = {self.relighter(name).used for name in self._kept} or {"exact"}
        return "compressed" if used == {"compressed"} else "exact"

    def _forget_all_but(self, names):
        for name in [n for n in self._relighters if n and n not in names]:
            self._relighters.pop(name).close()
        for kept in (self._kept, self._lit):
            for name in [n for n in kept if n not in names]:
                del kept[name]

    def close(self):
        """Let go of everything."""
        for relighter in self._relighters.values():
            relighter.close()
        self._kept, self._lit, self.received = {}, {}, None


def _lasts(lighting):
    """Whether a light is what it was where its key is: values of an array may change."""
    return lighting.environment is None or lighting.is_image or lighting.is_world
