"""The bake in memory, and its colours on the meshes of the scene."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from prt_core import PRTError, load
from prt_core.blender import colours, preview_look
from prt_core.blender.lamps import read_lamps
from prt_core.blender.world import read_environment
from prt_core.errors import expect
from prt_core.light import rotation_matrix
from prt_core.progress import beside
from prt_core.relighter import Relighter, lamp_signature
from prt_core.scene import changes, mesh_digests

from . import plan
from .studio import studio_lights

# One bake at a time: large ones fill the memory.
_HELD = []


class Preview:
    """A bake in memory.

    Attributes
    ----------
    path : str
    bake : prt_core.Bake
    relighter : prt_core.relighter.Relighter
    renamed : dict of str -> str
        Objects that have another name now.
    shown : Request
        What the colours on the meshes were made from, None where unknown.
    """

    def __init__(self, path, bake, caster):
        self.path, self.bake = path, bake
        self.relighter = Relighter(bake, caster)
        self.renamed, self.shown = {}, None


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


def held(scene=None):
    """The `Preview` in memory, of a scene; None where it is not loaded."""
    if not _HELD or (scene is not None and _HELD[0].path != path_of(scene)):
        return None
    return _HELD[0]


def path_of(scene):
    """Absolute path of the bake a scene shows, empty where none."""
    return str(Path(bpy.path.abspath(scene.prt.loaded))) if scene.prt.loaded else ""


def relative(path):
    """A path as the file keeps it: beside the file where it is."""
    try:
        return bpy.path.relpath(str(path)) if bpy.data.filepath else str(path)
    except ValueError:
        return str(path)


def load_steps(path, caster="auto"):
    """Load a bake into memory, in place of the one there; returns the `Preview`."""
    path = str(path)
    if not _HELD or _HELD[0].path != path:
        bake = yield from beside("load", load, path)
        forget()
        _HELD.append(Preview(path, bake, caster))
    return _HELD[0]


def forget():
    """Let go of the bake in memory."""
    while _HELD:
        _HELD.pop().relighter.close()


def follow(scene, path):
    """Keep a scene's bake within reach of the file that is about to be saved as `path`.

    A bake in the temporary folder moves beside the file; one beside a file of another folder is
    named in full.
    """
    where, home = path_of(scene), Path(path).parent
    if not where or not Path(where).is_dir():
        return
    if Path(bpy.app.tempdir) in Path(where).parents:
        target = home / "prt" / Path(where).name
        if target.exists():
            return
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(where, target)
        if _HELD and _HELD[0].path == where:
            _HELD[0].path, _HELD[0].bake.path = str(target), target
        scene.prt.loaded = f"//prt/{target.name}"
    elif home != Path(bpy.data.filepath).parent:
        scene.prt.loaded = where


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


def write(scene, preview, radiance, asked):
    """Colours onto the meshes, and the preview's look as the panel asks for it.

    Raises
    ------
    PRTError
        An object is gone or has another mesh now; then nothing was written.
    """
    settings = scene.prt
    found = preview.bake.colours(radiance)
    if settings.shown and settings.shown != settings.attribute:
        preview_look.restore(scene, [settings.shown])
    colours.write_all(
        preview.bake.scene,
        found,
        settings.attribute,
        settings.domain,
        renamed=preview.renamed,
        target=scene,
    )
    preview_look.show_colours(
        preview.bake.scene,
        settings.attribute,
        settings.material,
        preview.renamed,
        scene,
    )
    if settings.shown != settings.attribute:
        settings.shown = settings.attribute
    preview.shown = asked


def clear(scene):
    """Take the preview off a scene; how many objects changed."""
    names = {scene.prt.shown or scene.prt.attribute}
    changed = preview_look.restore(scene, names)
    scene.prt.shown = ""
    if _HELD:
        _HELD[0].shown = None
    return changed


def check_steps(scene, preview, pace=None):
    """How the scene differs from the bake (`Changes`); follows objects that were renamed."""
    meshes = yield from plan.read_steps(scene, [], pace)
    digests = yield from beside("scene", mesh_digests, meshes)
    found = changes(preview.bake.source, digests)
    preview.renamed = found.renamed
    return found


def missing(preview):
    """Whether an object that the bake colours is not there under its name."""
    return any(
        item.own_mesh
        and item.receives
        and preview.renamed.get(item.name, item.name) not in bpy.data.objects
        for item in preview.bake.scene.objects
    )
