"""The light of a scene's panel, as a value."""

from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from prt_core import Lighting, PRTError
from prt_core.blender.lamps import read_lamps
from prt_core.blender.world import read_environment
from prt_core.errors import expect
from prt_core.relight.blend import WeightedLight
from prt_core.sphere import rotation_matrix
from prt_core.transport import View

from . import preview, viewport
from .studio import studio_lights


@dataclass(frozen=True)
class Request:
    """What the panel asks for.

    Attributes
    ----------
    lights : tuple of WeightedLight
        The light of the panel, or the sets that are kept, each by its name and weight.
    form : {"auto", "exact"}
        What a `Relighter` multiplies light from far away with.
    key : tuple
        What the light depends on, images by the time of their file, and whether gloss is shown.
    view : View, or None
        From where gloss is seen.
    every : int
        One of so many points has its own lobes (see `Relighter.view_steps`).
    mapped : bool
        Whether wide lobes are looked up in maps of views.
    around : bool
        Whether colours are looked at from elsewhere too (see `View.above`).
    """

    lights: tuple
    form: str
    key: tuple
    view: View | None = None
    every: int = 1
    mapped: bool = False
    around: bool = False

    @staticmethod
    def of(lights, form, view, around=False):
        """The `Request` of some lights, with its key."""
        key = form, view is not None, around, *(light.key for light in lights)
        return Request(tuple(lights), form, key, view, around=around)

    @property
    def lighting(self):
        """The one `Lighting` that shines, for what can show no blend.

        Raises
        ------
        PRTError
            Several light sets shine, or none.
        """
        shining = [light for light in self.lights if light.weight > 0]
        expect(
            len(shining) == 1,
            f"light sets: {len(shining)} shine, this is of one; switch to it by its round button",
        )
        # A weight is a factor on the colours, as exposure is.
        (one,) = shining
        stops = one.lighting.exposure + float(np.log2(one.weight))
        return replace(one.lighting, exposure=stops)

    def steps(self, shown, pace=None):
        """Radiance of the points of a `Preview`'s bake; a generator of `Progress`."""
        shown.blend.form = self.form
        how = pace, self.view_of(shown), self.every, self.mapped
        radiance = yield from shown.blend.steps(self.lights, *how)
        shown.received = shown.blend.received
        return radiance

    def view_of(self, shown):
        """The `View` by which a `Preview`'s points are seen; None where gloss is not shown."""
        if self.view is None or not self.around:
            return self.view
        scene = shown.bake.scene
        return self.view.above(scene.to_world(scene.points.positions), scene.points.normals)

    def all_around(self):
        """The same for colours that stay, and are looked at from everywhere."""
        return self.of(self.lights, self.form, self.view, around=True)

    def sky(self, shown):
        """What is behind the scene, as a function of directions; None where nothing is."""
        return shown.blend.sky(self.lights)

    def each(self):
        """(name, `Request`) of each light alone, at weight 1."""
        for light in self.lights:
            one = [replace(light, weight=1.0)]
            yield light.name, self.of(one, self.form, self.view, self.around)

    def seen_from(self, view, every=1, mapped=False):
        """The same light seen from elsewhere."""
        return replace(self, view=view, every=every, mapped=mapped)

    @property
    def place(self):
        """From where gloss is seen, as something that can be compared; None without a view."""
        return None if self.view is None else viewport.place_of(self.view)

    def looks_like(self, other):
        """Whether the colours of two requests are the same."""
        one, two = ((each.key, each.place, each.every, each.mapped) for each in (self, other))
        return one == two


def request(scene, samples=None, depsgraph=None, rendered=False, shown=None):
    """The `Request` of a scene's light as it is now.

    Parameters
    ----------
    scene : bpy.types.Scene
    samples : int, optional
        Shadow rays a lamp; default: as the panel says.
    depsgraph : bpy.types.Depsgraph, optional
        Where a frame that renders is evaluated: what is animated is only there.
    rendered : bool
        Whether gloss is seen through the camera, whatever the panel says.
    shown : preview.Preview, optional
        What is asked; default: the bake in memory.

    Raises
    ------
    PRTError
        The world has a node that is not understood, a file is missing, or gloss is seen from a
        camera that is not there.
    """
    shown = shown or preview.held()
    view = view_of(scene, rendered, depsgraph if rendered else None, shown)
    scene = scene if depsgraph is None else scene.evaluated_get(depsgraph)
    settings = scene.prt
    sets = [("", 1.0, settings)]
    if settings.sets:
        sets = [(each.name, each.weight, each) for each in settings.sets]
    lamps = []
    if any(light.use_lamps for _, _, light in sets):
        lamps = read_lamps(scene, depsgraph=depsgraph)
    lights = [
        WeightedLight(name, _lighting(scene, light, lamps, samples, shown), weight)
        for name, weight, light in sets
    ]
    around = settings.seen_from == "CAMERA" and not rendered
    return Request.of(lights, "auto" if settings.use_compressed else "exact", view, around)


def _lighting(scene, light, lamps, samples, shown):
    """The `Lighting` of the panel's own light, or of a set; `lamps` are those of the scene."""
    environment, rotation, strength, suns = _environment(scene, light)
    return Lighting(
        environment,
        rotation=None if environment is None else rotation,
        strength=strength,
        sharp_sun=light.sharp_sun and environment is not None,
        lamps=suns + (_dimmed(lamps, light) if light.use_lamps else []),
        lamp_strength=1.0,
        lamp_samples=samples or light.lamp_samples,
        exposure=scene.prt.exposure,
        emission=_emission(light, shown),
    )


def _dimmed(lamps, light):
    """The scene's lamps as a set has them; those that are off are left out."""
    dimmed = []
    for lamp in lamps:
        how = light.lamps.get(lamp.name) if hasattr(light, "lamps") else None
        factor = 1.0 if how is None else how.strength
        power = np.asarray(lamp.power, np.float64) * factor
        if how is not None and how.recolour:
            power = np.max(power) * np.array(how.colour)
        if factor > 0:
            dimmed.append(lamp if how is None else replace(lamp, power=power))
    return dimmed


def view_of(scene, rendered=False, depsgraph=None, shown=None):
    """The `View` from where the gloss of the bake in memory is seen; None where it is not shown.

    Parameters
    ----------
    scene : bpy.types.Scene
    rendered : bool
        Whether it is seen through the camera, whatever the panel says.
    depsgraph : bpy.types.Depsgraph, optional
        Where a frame that renders is evaluated.
    shown : preview.Preview, optional
        What is seen; default: the bake in memory.
    """
    shown = shown or preview.held()
    if shown is None or not scene.prt.show_gloss or preview.no_gloss(shown):
        return None
    return viewport.view_of(scene, scene.prt.seen_from, rendered, depsgraph)


def _emission(light, shown):
    """How the emitters of a `Preview`, or None, shine that the panel, or a set, has changed."""
    names = preview.emitters(shown)
    return {
        item.name: (tuple(item.colour) if item.recolour else None, item.strength)
        for item in light.emitters
        if item.name in names and (item.recolour or item.strength != 1)
    }


def _environment(scene, settings):
    """The environment that the panel names, its rotation, its strength and its own suns."""
    rotation = rotation_matrix(float(np.degrees(settings.rotation)))
    if settings.light == "WORLD":
        world = read_environment(scene)
        if world is None:
            return None, rotation, settings.strength, []
        suns = world.turned_suns(rotation, settings.strength)
        return world.map, rotation @ world.rotation, settings.strength * world.strength, suns
    return image_of(settings), rotation, settings.strength, []


def image_of(light):
    """The path of the image that the panel's light, or a set, names.

    Raises
    ------
    PRTError
        It names none that is one.
    """
    whose = f"light '{light.name}'" if hasattr(light, "weight") else "light"
    if light.light == "FILE":
        expect(light.file, f"{whose}: choose an .exr or .hdr image")
        path = Path(bpy.path.abspath(light.file))
    else:
        expect(light.studio, f"{whose}: Blender has no studio lights here; choose an image")
        path = Path(studio_lights().get(light.studio, ""))
    if path.suffix.lower() not in {".exr", ".hdr"}:
        raise PRTError(f"{whose}: {path}: expected an .exr or .hdr image")
    return path
