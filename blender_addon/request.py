"""The light of a scene's panel, as a value."""

from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from prt_core import Lighting, PRTError
from prt_core.blender.lamps import read_lamps
from prt_core.blender.world import read_environment
from prt_core.errors import expect
from prt_core.sphere import rotation_matrix
from prt_core.transport import View

from . import preview, viewport
from .studio import studio_lights


@dataclass(frozen=True)
class Request:
    """What the panel asks for.

    Attributes
    ----------
    lighting : Lighting
    form : {"auto", "exact"}
        What `Relighter` multiplies light from far away with.
    key : tuple
        What the light depends on, images by the time of their file, and whether gloss is shown.
    view : View, or None
        From where gloss is seen.
    every : int
        One of so many points has its own lobes (see `Relighter.view_steps`).
    """

    lighting: Lighting
    form: str
    key: tuple
    view: View | None = None
    every: int = 1

    def steps(self, shown, pace=None):
        """Radiance of the points of a `Preview`'s bake; a generator of `Progress`."""
        relighter, view = shown.relighter, self.view
        relighter.form = self.form
        if view is not None and shown.has_light(self.key):
            return (yield from relighter.view_steps(view, pace, self.every))
        radiance = yield from relighter.steps(self.lighting, pace, view=view)
        shown.received = relighter.received
        if view is not None:
            shown.note_light(self.key)
        return radiance

    def seen_from(self, view, every=1):
        """The same light seen from elsewhere."""
        return replace(self, view=view, every=every)

    @property
    def place(self):
        """From where gloss is seen, as something that can be compared; None without a view."""
        return None if self.view is None else viewport.place_of(self.view)

    def looks_like(self, other):
        """Whether the colours of two requests are the same."""
        one, two = ((each.key, each.place, each.every) for each in (self, other))
        return one == two


def request(scene, samples=None, depsgraph=None, rendered=False):
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

    Raises
    ------
    PRTError
        The world has a node that is not understood, a file is missing, or gloss is seen from a
        camera that is not there.
    """
    view = view_of(scene, rendered, depsgraph if rendered else None)
    scene = scene if depsgraph is None else scene.evaluated_get(depsgraph)
    settings = scene.prt
    light, rotation, strength, suns = _environment(scene)
    lighting = Lighting(
        light,
        rotation=None if light is None else rotation,
        strength=strength,
        sharp_sun=settings.sharp_sun and light is not None,
        lamps=suns + (read_lamps(scene, depsgraph=depsgraph) if settings.use_lamps else []),
        lamp_strength=1.0,
        lamp_samples=samples or settings.lamp_samples,
        exposure=settings.exposure,
        emission=_emission(settings),
    )
    form = "auto" if settings.use_compressed else "exact"
    return Request(lighting, form, (form, view is not None, *lighting.key), view)


def view_of(scene, rendered=False, depsgraph=None):
    """The `View` from where the gloss of the bake in memory is seen; None where it is not shown.

    Parameters
    ----------
    scene : bpy.types.Scene
    rendered : bool
        Whether it is seen through the camera, whatever the panel says.
    depsgraph : bpy.types.Depsgraph, optional
        Where a frame that renders is evaluated.
    """
    held = preview.held()
    if held is None or not scene.prt.show_gloss or preview.no_gloss(held):
        return None
    return viewport.view_of(scene, scene.prt.seen_from, rendered, depsgraph)


def _emission(settings):
    """How the emitters of the bake in memory shine that the panel has changed."""
    names = preview.emitters(preview.held())
    return {
        item.name: (tuple(item.colour) if item.recolour else None, item.strength)
        for item in settings.emitters
        if item.name in names and (item.recolour or item.strength != 1)
    }


def _environment(scene):
    """The environment that the panel names, its rotation, its strength and its own suns."""
    settings = scene.prt
    rotation = rotation_matrix(float(np.degrees(settings.rotation)))
    if settings.light == "WORLD":
        world = read_environment(scene)
        if world is None:
            return None, rotation, settings.strength, []
        suns = world.turned_suns(rotation, settings.strength)
        return world.map, rotation @ world.rotation, settings.strength * world.strength, suns
    if settings.light == "FILE":
        expect(settings.file, "light: choose an .exr or .hdr image")
        light = Path(bpy.path.abspath(settings.file))
    else:
        expect(settings.studio, "light: Blender has no studio lights here; choose an image")
        light = Path(studio_lights().get(settings.studio, ""))
    if light.suffix.lower() not in {".exr", ".hdr"}:
        raise PRTError(f"{light}: expected an .exr or .hdr image")
    return light, rotation, settings.strength, []
