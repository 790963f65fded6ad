"""What a bake of a scene would be: its settings, its cost, and what is wrong with it.

A `Reading` is what the meshes of a scene are like, to tell whether a bake is of them; a `Plan` is
what baking them would cost. Both are made when asked for, or in idle moments, and kept here.
"""

import os
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy
import numpy as np

from prt_core import BakeSettings, PRTError, Scene
from prt_core.bake.preflight import preflight
from prt_core.blender.depsgraph import read_meshes_steps
from prt_core.blender.identity import by_uid, place_of
from prt_core.blender.stand_ins import is_copy, is_kept
from prt_core.rays.caster import known_casters
from prt_core.runtime.main_thread import in_thread
from prt_core.scene import mesh_digests
from prt_core.scene.remarks import grouped

from .naming import bake_name
from .shapes import GEOMETRY, groups_of, shape_of

# What a plan or a reading may have taken to be made again without being asked for: seconds, and
# seconds for which it held the window; corners that a scene may show to be read for the first time.
_MOST_SECONDS, _MOST_HELD, _MOST_CORNERS = 2.0, 0.25, 2_000_000
# Points of a scene that is kept with its plan, at most: some 50 MB.
_MOST_KEPT = 250_000
# Of scenes by `session_uid`: their plans and readings; which of them may no longer hold; whose
# panel asked for a plan.
_PLANS, _READINGS = {}, {}
_OLD_PLANS, _OLD_READINGS, _WANTED = set(), set(), set()
# Blender's temporary folders of this session: it takes a new one with new preferences.
_TEMPORARY = set()


@dataclass
class Reading:
    """The meshes of a scene, as far as a bake depends on them.

    Attributes
    ----------
    digests : dict of str -> str
        Of each mesh; none where nothing can be baked.
    places : dict of str -> (str, str)
        Name and library of the object that each mesh belongs to.
    uids : dict of str -> int
        `session_uid` of these objects, where they are in the file.
    shape : dict of int -> tuple
    groups : tuple
        What can be compared quickly (see `shape_of` and `groups_of`).
    seconds, held : float
        How long it took, and its longest step: Blender evaluates the scene for renders.
    gloss : bool
        Whether materials were read with it: digests of the others are not the same.
    """

    digests: dict
    places: dict
    uids: dict
    shape: dict
    groups: tuple = ()
    seconds: float = 0.0
    held: float = 0.0
    gloss: bool = False


@dataclass
class Plan:
    """A scene as it would be baked.

    Attributes
    ----------
    cost : prt_core.bake.preflight.Preflight, or None where there is nothing to bake
    back_end : str
    messages : list of str
        What would be ignored or replaced.
    built : Scene or None
        The scene as it is baked, for a first look at it; None of large ones.
    digests : dict of str -> str
        Of its meshes.
    seconds, held : float
        How long it took to make, and its longest step.
    """

    cost: object = None
    back_end: str = ""
    messages: list = field(default_factory=list)
    built: object = None
    digests: dict = field(default_factory=dict)
    seconds: float = 0.0
    held: float = 0.0


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
        gloss=chosen.gloss,
    )


def receivers(scene):
    """Names of the objects that receive colours; None for all.

    Raises
    ------
    PRTError
        None does.
    """
    candidates = [o for o in scene.objects if o.type in GEOMETRY or o.instance_type == "COLLECTION"]
    candidates = [o for o in candidates if not (is_copy(o) or is_kept(o))]
    chosen = [o.name_full for o in candidates if o.prt.receives]
    if candidates and not chosen:
        raise PRTError("objects: none receives colours; switch some on under Objects")
    return None if len(chosen) == len(candidates) else chosen


def two_sided(scene):
    """Names of the objects whose backs are lit as well."""
    return [o.name_full for o in scene.objects if o.prt.two_sided]


def folder(scene, file=None):
    """Where bakes of a scene are kept; Blender's temporary folder while the file has no name.

    Parameters
    ----------
    scene : bpy.types.Scene
    file : str, optional
        The file as it will be called; default: as it is.
    """
    file = bpy.data.filepath if file is None else file
    chosen = scene.prt.folder or "//prt"
    if not chosen.startswith("//"):
        return Path(bpy.path.abspath(chosen))
    if not file:
        _TEMPORARY.add(Path(bpy.app.tempdir))
        return Path(bpy.app.tempdir) / "prt"
    return Path(os.path.normpath(bpy.path.abspath(chosen, start=str(Path(file).parent))))


def is_temporary(path):
    """Whether a bake lies where Blender removes it at its end."""
    return bool(path) and not _TEMPORARY.isdisjoint(Path(path).parents)


def output_path(scene, file=None):
    """Where the next bake goes."""
    file = bpy.data.filepath if file is None else file
    return folder(scene, file) / f"{bake_name(scene, file)}.prt"


def back_end(scene):
    """The caster that the scene's choice stands for here."""
    if scene.prt.caster != "auto":
        return scene.prt.caster
    return next(name for name in ("embree", "blender") if name in known_casters())


def read_steps(scene, messages=None, pace=None, gloss=False):
    """Read the meshes of a scene as its panel says they are baked, and keep its `Reading`.

    A generator of `Progress`; returns the meshes.

    Raises
    ------
    PRTError
        Nothing there can be baked; the reading that is kept holds no mesh then.
    """
    start, uid = time.perf_counter(), scene.session_uid
    _OLD_READINGS.discard(uid)
    try:
        wanted = receivers(scene), two_sided(scene)
        steps = read_meshes_steps(uid, *wanted, messages, strict=False, pace=pace, gloss=gloss)
        meshes, held = yield from _timed(steps)
        digests = yield from in_thread("scene", mesh_digests, meshes)
    except PRTError:
        scene = by_uid(bpy.data.scenes, uid)
        _READINGS[uid] = Reading({}, {}, {}, shape_of(scene), groups_of(scene))
        raise
    except GeneratorExit:
        _OLD_READINGS.add(uid)
        raise
    places = {mesh.name: (mesh.owner, mesh.library) for mesh in meshes}
    scene = by_uid(bpy.data.scenes, uid)
    uid_at = {} if scene is None else {place_of(o): o.session_uid for o in scene.objects}
    uids = {name: uid_at[place] for name, place in places.items() if place in uid_at}
    seconds = time.perf_counter() - start
    quick = shape_of(scene), groups_of(scene)
    _READINGS[uid] = Reading(digests, places, uids, *quick, seconds, held, gloss)
    return meshes


def _timed(steps):
    """The steps of a generator; returns its result and the seconds of its longest step."""
    longest = 0.0
    while True:
        start = time.perf_counter()
        try:
            progress = next(steps)
        except StopIteration as end:
            return end.value, max(longest, time.perf_counter() - start)
        longest = max(longest, time.perf_counter() - start)
        yield progress


def regrouped(scene):
    """Whether what is in a scene, or renders of it, is not as it was when last read.

    Blender says that all collections have changed whenever a scene comes or goes, also one of ours.
    """
    read = _READINGS.get(scene.session_uid)
    return read is None or read.groups != groups_of(scene) or bool(moved(scene))


def moved(scene, depsgraph=None):
    """Names of the objects that are not where, or as large as, they were when last read."""
    read = _READINGS.get(scene.session_uid)
    if read is None:
        return []
    now = shape_of(scene, depsgraph)
    names = []
    for uid in {**read.shape, **now}:
        old, new = read.shape.get(uid), now.get(uid)
        if (
            old is None
            or new is None
            or old[2:] != new[2:]
            or not np.allclose(old[1], new[1], 1e-6)
        ):
            names.append((new or old)[0])
    return names


def steps(scene, pace=None, rays_per_second=None, again=True):
    """Make the plan of a scene and keep it; a generator of `Progress` that returns it.

    Parameters
    ----------
    scene : bpy.types.Scene
    pace : float, optional
    rays_per_second : float, optional
        As `preflight` takes it.
    again : bool
        Whether the scene is read again also where only settings have changed since.

    Raises
    ------
    PRTError
        Nothing there can be baked; the plan that is kept says so too.
    """
    start, uid = time.perf_counter(), scene.session_uid
    planned = Plan(back_end=back_end(scene))
    earlier = None if again else _still_built(scene)
    if earlier is not None:
        cost = preflight(earlier.built, bake_settings(scene), planned.back_end, rays_per_second)
        _PLANS[uid] = replace(earlier, cost=cost, back_end=planned.back_end)
        _OLD_PLANS.discard(uid)
        _WANTED.discard(uid)
        return _PLANS[uid]
    _OLD_PLANS.discard(uid)
    _WANTED.discard(uid)
    try:
        settings = bake_settings(scene)
        meshes = yield from read_steps(scene, planned.messages, pace, settings.gloss)
        built = yield from in_thread("scene", Scene.from_meshes, meshes)
        planned.messages[:] = grouped([*planned.messages, *built.messages], meshes)
        planned.cost = preflight(built, settings, planned.back_end, rays_per_second)
        if len(built.points) <= _MOST_KEPT:
            planned.built, planned.digests = built, reading_of(uid).digests
    except PRTError as error:
        planned.messages.append(str(error))
        _keep(uid, planned, start)
        raise
    except GeneratorExit:
        _OLD_PLANS.add(uid)
        raise
    _keep(uid, planned, start)
    return planned


def _keep(uid, planned, start):
    planned.seconds = time.perf_counter() - start
    read = _READINGS.get(uid)
    planned.held = 0.0 if read is None else read.held
    _PLANS[uid] = planned


def of(scene):
    """The `Plan` of a scene, or None; and whether it still holds."""
    return _PLANS.get(scene.session_uid), scene.session_uid not in _OLD_PLANS


def built(scene):
    """A scene as its plan has built it, and its digests; (None, None) where it may have changed."""
    planned, holds = of(scene)
    read, is_read = reading(scene)
    if planned is None or read is None or not (holds and is_read):
        return None, None
    same = planned.built is not None and planned.digests == read.digests
    return (planned.built, planned.digests) if same else (None, None)


def _still_built(scene):
    """The plan of a scene where it holds but for its settings, else None."""
    planned, (read, is_read) = _PLANS.get(scene.session_uid), reading(scene)
    if planned is None or planned.built is None or read is None or not is_read:
        return None
    same = planned.digests == read.digests and read.gloss == scene.prt.gloss
    return planned if same else None


def reading(scene):
    """The last `Reading` of a scene, or None; and whether it still holds."""
    return _READINGS.get(scene.session_uid), scene.session_uid not in _OLD_READINGS


def reading_of(uid):
    """The last `Reading` of a scene by its `session_uid`, or None."""
    return _READINGS.get(uid)


def is_quick(kept):
    """Whether a `Reading` or `Plan` may be made again without being asked for."""
    return kept.seconds < _MOST_SECONDS and kept.held < _MOST_HELD


def want(scene):
    """Ask for a plan at the next idle moment: none there, or an old one that is made quickly."""
    planned, holds = of(scene)
    if planned is None and _corners_shown() < _MOST_CORNERS:
        _WANTED.add(scene.session_uid)
    elif planned is not None and not holds and (is_quick(planned) or _still_built(scene)):
        _WANTED.add(scene.session_uid)


def _corners_shown():
    """Corners of all meshes that the window has evaluated: about what a reading would cost."""
    depsgraph = bpy.context.view_layer.depsgraph
    if depsgraph is None:
        return 0
    return sum(len(o.data.loops) for o in depsgraph.objects if o.type == "MESH")


def wanted():
    """A scene whose plan was asked for, or None."""
    while _WANTED:
        scene = by_uid(bpy.data.scenes, next(iter(_WANTED)))
        if scene is not None:
            return scene
        _WANTED.clear()
    return None


def outdate(scene, geometry=True):
    """The plan of a scene may no longer hold, and its reading neither where `geometry` changed."""
    _OLD_PLANS.add(scene.session_uid)
    if geometry:
        _OLD_READINGS.add(scene.session_uid)


def forget():
    """Forget all plans: another file."""
    for kept in (_PLANS, _READINGS, _OLD_PLANS, _OLD_READINGS, _WANTED):
        kept.clear()
