"""The light of a scene's panel, as a value."""

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from prt_core import PRTError
from prt_core.blender.lamps import read_lamps
from prt_core.blender.world import read_environment
from prt_core.errors import expect
from prt_core.relight.lamps import lamp_signature
from prt_core.sphere import rotation_matrix

from .studio import studio_lights


@dataclass(frozen=True)
class Request:
    """The light of a scene's panel, as `Relighter.relight` takes it."""

    options: dict
    key: tuple
    transport: str = "auto"

    def steps(self, preview, pace=None):
        """Radiance of the bake's points; a generator of `Progress`."""
        preview.relighter.transport = self.transport
        return preview.relighter.steps(pace=pace, **self.options)


def request(scene, samples=None, depsgraph=None):
    """The `Request` of a scene's light as it is now.

    Parameters
    ----------
    scene : bpy.types.Scene
    samples : int, optional
        Shadow rays a lamp; default: as the panel says.
    depsgraph : bpy.types.Depsgraph, optional
        Where a frame that renders is evaluated: what is animated is only there.

    Raises
    ------
    PRTError
        The world has a node that is not understood, or a file is missing.
    """
    scene = scene if depsgraph is None else scene.evaluated_get(depsgraph)
    settings = scene.prt
    degrees = float(np.degrees(settings.rotation))
    rotation, strength, light = rotation_matrix(degrees), settings.strength, None
    if settings.light == "WORLD":
        found = read_environment(scene)
        if found is not None:
            light, rotation = found.map, rotation @ found.rotation
            strength = strength * found.strength
        name = id(light)
    elif settings.light == "FILE":
        expect(settings.file, "light: choose an .exr or .hdr image")
        light = name = Path(bpy.path.abspath(settings.file))
    else:
        light = name = Path(studio_lights().get(settings.studio, ""))
        expect(settings.studio, "light: Blender has no studio lights here; choose an image")
    lamps = read_lamps(scene, depsgraph=depsgraph) if settings.use_lamps else []
    samples = samples or settings.lamp_samples
    if isinstance(light, Path) and light.suffix.lower() not in {".exr", ".hdr"}:
        raise PRTError(f"{light}: expected an .exr or .hdr image")
    options = {
        "light": light,
        "rotation": None if light is None else rotation,
        "light_strength": strength,
        "strength": float(2.0**settings.exposure),
        "sharp_sun": settings.sharp_sun and light is not None,
        "lamps": lamps,
        "lamp_samples": samples,
    }
    stamp = light.stat().st_mtime_ns if isinstance(light, Path) and light.is_file() else 0
    needs_samples = any(not lamp.is_small for lamp in lamps) or options["sharp_sun"]
    transport = "auto" if settings.use_compressed else "exact"
    key = (
        transport, name, stamp, rotation.tobytes(), strength, options["strength"],
        options["sharp_sun"],
        tuple(lamp_signature(lamp) for lamp in lamps), samples if needs_samples else 0,
    )  # fmt: skip
    return Request(options, key, transport)
