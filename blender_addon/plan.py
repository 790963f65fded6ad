"""What a bake of a scene would be: its settings, its cost, and what is wrong with it.

A `Plan` is made when asked for, or in idle moments, and drawn from memory.
"""

import time
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from prt_core import BakeSettings, PRTError, Scene
from prt_core.blender.depsgraph import read_meshes_steps
from prt_core.blender.preview_look import renders
from prt_core.preflight import preflight
from prt_core.progress import beside
from prt_core.rays.caster import known_casters
from prt_core.scene import mesh_digests

GEOMETRY = {"MESH", "CURVE", "SURFACE", "META", "FONT"}
# Plans of scenes by name; those that may no longer hold; those whose panel asked for one.
_PLANS, _OLD, _WANTED = {}, set(), set()


@dataclass
class Plan:
    """A scene as it would be baked.

    Attributes
    ----------
    cost : prt_core.preflight.Preflight, or None where there is nothing to bake
    back_end : str
    digests : dict of str -> str
        Of each mesh, to tell whether a bake is of this scene.
    messages : list of str
        What would be ignored or replaced.
    seconds : float
        How long it took to make.
    """

    cost: object = None
    back_end: str = ""
    digests: dict = field(default_factory=dict)
    messages: list = field(default_factory=list)
    seconds: float = 0.0


def bake_settings(scene):
    """`BakeSettings` of a scene's panel."""
    chosen = scene.prt
    return BakeSettings(
        resolution=int(chosen.resolution),
        bounces=None if chosen.all_bounces else chosen.bounces,
        # As it was typed: Blender keeps single precision.
        tolerance=round(chosen.tolerance, 6),
        caster=chosen.caster,
        method=chosen.method,
    )


def receivers(scene):
    """Names of the objects that receive colours; None for all.

    Raises
    ------
    PRTError
        None does.
    """
    there = [o for o in scene.objects if o.type in GEOMETRY or o.instance_type == "COLLECTION"]
    chosen = [o.name for o in there if o.prt.receives]
    if there and not chosen:
        raise PRTError("objects: none receives colours; switch some on under Objects")
    return None if len(chosen) == len(there) else chosen


def two_sided(scene):
    """Names of the objects whose backs are lit as well."""
    return [o.name for o in scene.objects if o.prt.two_sided]


def folder(scene):
    """Where bakes of a scene are kept; Blender's temporary folder while the file has no name."""
    chosen = scene.prt.folder or "//prt"
    if chosen.startswith("//") and not bpy.data.filepath:
        return Path(bpy.app.tempdir) / "prt"
    return Path(bpy.path.abspath(chosen))


def output_path(scene):
    """Where the next bake goes."""
    name = bpy.path.clean_name(scene.prt.name or scene.name)
    return folder(scene) / f"{name}.prt"


def back_end(scene):
    """The caster that the scene's choice stands for here."""
    if scene.prt.caster != "auto":
        return scene.prt.caster
    return next(name for name in ("embree", "blender") if name in known_casters())


def read_steps(scene, messages, pace):
    """The meshes of a scene as its panel says they are baked; a generator of `Progress`."""
    return read_meshes_steps(
        scene.name, receivers(scene), two_sided(scene), messages, strict=False, pace=pace
    )


def steps(scene, pace=None, rays_per_second=None):
    """Make the plan of a scene and keep it; a generator of `Progress` that returns it.

    Raises
    ------
    PRTError
        Nothing there can be baked; the plan that is kept says so too.
    """
    start, name = time.perf_counter(), scene.name
    made = Plan(back_end=back_end(scene))
    _OLD.discard(name)
    _WANTED.discard(name)
    try:
        settings = bake_settings(scene)
        meshes = yield from read_steps(scene, made.messages, pace)
        made.digests = yield from beside("scene", mesh_digests, meshes)
        built = yield from beside("scene", Scene.from_meshes, meshes)
        made.messages += built.messages
        made.cost = preflight(built, settings, made.back_end, rays_per_second)
    except PRTError as error:
        made.messages.append(str(error))
        _keep(name, made, start)
        raise
    except GeneratorExit:
        _OLD.add(name)
        raise
    _keep(name, made, start)
    return made


def _keep(name, made, start):
    made.seconds = time.perf_counter() - start
    _PLANS[name] = made


def of(scene):
    """The `Plan` of a scene, or None; and whether it still holds."""
    return _PLANS.get(scene.name), scene.name not in _OLD


def want(scene):
    """Ask for a plan at the next idle moment: none there, or an old one that was made quickly."""
    made, holds = of(scene)
    if made is None or (not holds and made.seconds < 2.0):
        _WANTED.add(scene.name)


def wanted():
    """A scene whose plan was asked for, or None."""
    while _WANTED:
        scene = bpy.data.scenes.get(next(iter(_WANTED)))
        if scene is not None:
            return scene
        _WANTED.clear()
    return None


def outdate(scene):
    """The plan of a scene may no longer hold."""
    _OLD.add(scene.name)


def forget():
    """Forget all plans: another file."""
    for kept in (_PLANS, _OLD, _WANTED):
        kept.clear()


def warnings(scene):
    """What a person should know before baking: (text, operator that helps or None, its object)."""
    found = []
    if not bpy.data.filepath and scene.prt.folder.startswith("//"):
        found.append(
            ("File not saved: bakes are kept in a temporary folder", "wm.save_mainfile", None)
        )
    for item in scene.objects:
        if item.type in GEOMETRY and item.prt.receives and not renders(item):
            found.append((f"{item.name}: hidden in renders, not baked", "prt.unhide", item.name))
    made, _ = of(scene)
    if made is None:
        return found
    if made.cost is not None:
        for name, (distance, _) in made.cost.coarse.items():
            item = scene.objects.get(name)
            helps = "prt.subdivide" if item is not None and item.type == "MESH" else None
            text = f"{name}: a vertex every {distance:.2g}, too few for shadows"
            found.append((text, helps, name))
    return found + [(text, None, None) for text in made.messages]
