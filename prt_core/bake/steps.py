"""The bake: visibility and gather rays of a scene, block by block into a store."""

import time
from dataclasses import dataclass, field

from prt_core.bake.bounces import Bounced, bounce_steps, gather_so_far
from prt_core.bake.earlier import (
    Earlier,
    KeptDetails,
    earlier_bake,
    expect_objects,
    taken,
)
from prt_core.bake.emission import bounced_emission_steps, emission_steps, read_direct
from prt_core.bake.gloss_certificate import gloss_certificate_steps
from prt_core.bake.inputs import expect_bake_input, unless_begun
from prt_core.bake.lights import Beside, keep_lights, light_attributes
from prt_core.bake.memory import Memory
from prt_core.bake.pictures import Pictures
from prt_core.bake.reflections import reflection_steps
from prt_core.bake.report import bake_report
from prt_core.bake.reuse import Reuse, note_reuse, reuse_of
from prt_core.bake.settings import BakeSettings
from prt_core.bake.stages import WORK, is_planned, sum_work
from prt_core.bake.visibility_stage import comes_in_blocks, visibility_steps
from prt_core.errors import expect, expect_kind, expect_number, system_errors
from prt_core.rays import RelayCaster
from prt_core.runtime.machine import return_memory
from prt_core.runtime.main_thread import MainThreadCalls, steps_in_thread
from prt_core.runtime.progress import STOP, Progress
from prt_core.scene import Scene, expect_camera, with_details
from prt_core.sphere import CubeMap
from prt_core.store import (
    BakeStore,
    begin_bake,
    check_scene,
    damage_as_error,
    finish_bake,
    read_backs,
    read_details,
    write_scene,
)
from prt_core.transport import detail_steps, side_steps


def bake_steps(
    scene,
    path,
    settings=None,
    lamps=(),
    world=None,
    camera=None,
    source=None,
    restart=False,
    pace=None,
    lights=None,
    origin=None,
    cameras=None,
    pictures=None,
    memory=None,
    reuse=None,
    only=None,
    view_transform=None,
):
    """Bake a scene into a store; a generator of `Progress` (see `runtime.progress.run`).

    A store that is there and unfinished is gone on with; a finished one of the same scene and
    settings is left as it is.

    Parameters
    ----------
    scene : Scene
    path : str or Path
        `NAME.prt`, a folder.
    settings : BakeSettings
    lamps : sequence of Lamp
    world : (n_directions, 3) float32 or BakedWorld, optional
    camera : Camera, optional
        Kept with the bake for relighting and pictures.
    source : dict of str -> str
        Kept with the bake: the digest of each mesh it was made from (see `mesh_digests`).
    restart : bool or "changed"
        Begin anew whatever is there; or only where that is of another scene or other settings.
        What is there stays until the new bake is finished, which is made in `NAME.prt.restart`.
    pace : float, optional
        Seconds a step may take, for a user interface; then the work is done beside the caller, in
        a thread, but for rays that only the caller may cast. Default: whole blocks. The result is
        the same.
    lights : dict of str -> (n_directions, 3) float32, or callable() -> dict, optional
        Under which the sampled visibility must be within the tolerance; asked for when they are
        needed. Default: an even sky and two soft suns.
    origin : dict of str -> str, optional
        Kept with the bake: the `file` (seen from the bake's folder), the `scene` and the `frame`
        it is of.
    cameras : dict of str -> Camera, optional
        Kept with the bake: all cameras of the scene by name, for views.
    pictures : Pictures, optional
        Is told what is known while the bake runs, and hands it out; the bake is the same.
    memory : float, optional
        Gigabytes that the bake may take, beside the scene; default: half of what there is. Where
        it is too little for the points, they are sampled in smaller tiles.
    reuse : str or Path, optional
        An earlier bake of the scene, which may be the one at `path`: what a change cannot have
        touched is taken from it. Where nothing can be, the report says why.
    only : sequence of str, optional
        With `reuse`: objects whose points are asked again; those of others stay as they were.
    view_transform : ViewTransform, optional
        Kept with the bake: how its pictures are shown.

    Returns
    -------
    dict
        The report: points, directions, back_end, rays, seconds by stage, bytes, peak_bytes,
        error (of the bounces), method, entries_percent, certificate, visibility_error,
        tolerance_met, skipped, messages; and `reused`, where that was asked for.

    Raises
    ------
    PRTError
        The store belongs to another scene or other settings, or is no bake.
    """
    settings = BakeSettings() if settings is None else settings
    expect_kind("settings", settings, BakeSettings)
    cube_map = CubeMap(settings.resolution)
    camera = None if camera is None else expect_camera(camera)
    given = lamps, world, camera, source, restart, pace, lights, origin, cameras, view_transform
    world = expect_bake_input(scene, path, cube_map, *given)
    if pictures is not None:
        expect_kind("pictures", pictures, Pictures)
    memory = Memory.of(memory)
    expect(only is None or reuse is not None, "only: changes nothing without reuse")
    if only is not None:
        expect_objects(scene, only)
    casters = []

    def caster():
        casters.append(scene.make_caster(settings.caster, "diffuse", settings.resolution))
        return casters[0]

    beside = Beside(lamps, world, camera, source, origin, cameras, view_transform)
    try:
        with system_errors(path), unless_begun(path):
            given = scene, path, settings, beside, restart, lights, pictures, memory, reuse, only
            if pace is None:
                return (yield from _bake(*given, caster))
            calls = MainThreadCalls()

            def relayed():
                # Threaded rays are cast where the work is, and a stop waits for a part of them.
                plain = calls.call(caster)
                return plain if plain.threads > 1 else RelayCaster(plain, calls, pace)

            return (yield from steps_in_thread(_bake(*given, relayed, STOP), calls, "scene"))
    finally:
        for item in casters:
            item.close()


def _bake(
    scene, path, settings, beside, restart, lights, pictures, memory, reuse, only, new_caster,
    pace=None,
):  # fmt: skip
    """`bake_steps`, with a function that makes the caster once rays are needed."""
    cube_map = CubeMap(settings.resolution)
    given = scene, path, settings, beside, restart, new_caster
    begun = yield from begin_steps(*given, pictures, memory, reuse, only)
    if begun.report is not None:
        return begun.report
    report = yield from rest_steps(
        begun, cube_map, settings, lights, pace=pace, pictures=pictures, memory=memory
    )
    finish_bake(begun.store, path)
    return report


@dataclass
class Begun:
    """A bake whose scene is stored.

    Attributes
    ----------
    store : BakeStore
    scene : Scene
        With its details; None where the bake is finished.
    caster : RayCaster, or None
    seconds : dict of str -> float
        By stage.
    resumed : bool
        Whether some of it was there.
    report : dict, or None
        Of a bake that is finished.
    reuse : Reuse or str, or None
        What is taken from an earlier bake, or why nothing is.
    """

    store: BakeStore
    scene: Scene | None = None
    caster: object = None
    seconds: dict = field(default_factory=dict)
    resumed: bool = False
    report: dict | None = None
    reuse: object = None


def begin_steps(
    scene, path, settings, beside, restart, new_caster, pictures=None, memory=None, reuse=None,
    only=None,
):  # fmt: skip
    """The first part of a bake: whose it is, and its scene, in a store; yields `Progress`.

    Parameters
    ----------
    scene, path, settings
        See `bake_steps`.
    beside : Beside
    restart
        See `bake_steps`.
    new_caster : callable() -> RayCaster
    pictures : Pictures, optional
    memory : Memory, optional
        Where there are pictures.
    reuse, only
        See `bake_steps`.

    Returns
    -------
    Begun
    """
    cube_map = CubeMap(settings.resolution)
    check_scene(scene)
    attributes, arrays = light_attributes(beside)
    identity = {
        "scene": scene.fingerprint(),
        **{k: v for k, v in settings.stored().items() if k != "caster"},
    }
    if only is not None:
        # Of a selection alone: no bake of the scene, until what it left is baked as well.
        identity["selection"] = sorted(only)
    yield Progress("scene", 0, 0)
    store = begin_bake(path, identity, restart)
    if store.is_complete:
        if store.is_sound():
            keep_lights(store, attributes, arrays)
            with damage_as_error(path):
                return Begun(store, report=finish_bake(store, path).attributes["report"])
        # What is damaged is made again, as if the bake had been stopped before.
        store.update(complete=False)
    earlier = None if reuse is None else earlier_bake(reuse, scene, settings)
    # A caster that cannot be made leaves no folder.
    caster = new_caster()
    resumed = "identity" in store.attributes
    if not resumed:
        # Whose it is at once: one of an unknown file is never replaced unasked.
        store.update(identity=identity, settings=settings.stored(), **attributes)
    taken_from = taken(earlier, only)
    if store.attributes.get("taken_from") != taken_from:
        # What there is was made from another bake, or from none: it is made again.
        store.update(taken_from=taken_from, sampled=None)
    seconds = stored_seconds(store)
    if pictures is not None:
        joined = comes_in_blocks(settings, len(scene.points), cube_map, memory)
        pictures.begin(scene, cube_map, settings, caster, beside, joined)
        yield Progress("scene", 0, 0)
    scene = yield from _detailed(store, scene, caster, settings, beside, seconds, earlier)
    if pictures is not None:
        pictures.detailed(scene)
    keep_lights(store, attributes, arrays)
    # What building the scene and looking for details took.
    return_memory()
    yield Progress("scene", 0, 0)
    reuse = reuse_of(earlier, scene, only)
    return Begun(store, scene, caster, seconds, resumed, reuse=reuse)


def rest_steps(
    begun, cube_map, settings, lights, *, emitted=None, pace=None, pictures=None, here=True,
    memory=None,
):  # fmt: skip
    """All of a bake but its beginning, in its store, which is sealed; yields `Progress`.

    Parameters
    ----------
    begun : Begun
    cube_map : CubeMap
    settings : BakeSettings
    lights
        See `bake_steps`.
    emitted : EmissionResult, optional
        Where what emitters send out is baked.
    pace, pictures
        See `bake_steps`.
    here : bool
        Whether blocks that are missing are computed; otherwise they are said.
    memory : Memory, optional

    Returns
    -------
    dict
        The report.

    Raises
    ------
    BlocksMissing
    """
    memory = memory or Memory.of()
    store, scene, caster, seconds = begun.store, begun.scene, begun.caster, begun.seconds
    given = store, scene, cube_map, caster, settings
    reuse = begun.reuse if isinstance(begun.reuse, Reuse) else None
    more = pictures, here, memory, reuse
    seen = yield from visibility_steps(*given, lights, seconds, pace, *more)
    return_memory()
    reflected = yield from reflection_steps(*given, seconds)
    if emitted is None:
        emitted = yield from emission_steps(store, scene, caster, settings, seconds)
    certified = yield from gloss_certificate_steps(*given, lights, seconds, memory)
    if pictures is not None and scene.emitters:
        pictures.emitted(read_direct(store))
    bounced = Bounced()
    if settings.bounces != 0:
        bounced = yield from bounce_steps(*given, seconds, emitted.probes, *more)
        bounced = bounced if reuse is None else reuse.of_all(bounced)
    if pictures is not None and pictures.to_the_end:
        with damage_as_error(store.path):
            gather = gather_so_far(store, bounced.rounds, memory)
            pictures.finished(lambda: store.array("visibility")[...], gather, bounced.error or 0.0)
    return_memory()
    yield from bounced_emission_steps(store, scene, bounced.rounds, settings, seconds, memory)
    planned, work = is_planned(store), []
    if planned:
        seen["too_deep"], work = sum_work(store, seconds)
    with damage_as_error(store.path):
        report = bake_report(
            scene,
            cube_map,
            caster,
            settings,
            seen,
            emitted,
            bounced,
            seconds,
            store,
            reflected,
            certified,
        )
    if planned:
        report["messages"].append("baked in blocks of work: times are those of all who computed")
    elif begun.resumed:
        report["messages"].append("the bake was stopped and went on: times are those since then")
    if begun.resumed:
        # Some of the rays were cast before the clock was started.
        report["rays_per_second"] = None
    note_reuse(store, report, begun.reuse)
    store.seal(without=(WORK,), dropped=work, report=report, seconds=seconds)
    return report


def stored_seconds(store):
    """Seconds by stage that a bake under way has taken."""
    with damage_as_error(store.path):
        return {
            stage: expect_number(f"seconds of {stage}", value, least=0)
            for stage, value in store.attributes.get("seconds", {}).items()
        }


def _detailed(store, scene, caster, settings, beside, seconds, earlier):
    """The scene with points on backs, and hidden ones in gaps and rooms within a face, stored.

    They are found by rays: what goes on takes those that it began with, where they are whole.
    """
    if settings.bounces != 0:
        sided = read_backs(store, scene)
        places = None if sided is None else read_details(store, sided)
        if places is None:
            start = time.perf_counter()
            lit_by = beside.lamps, beside.camera
            sided, probes = yield from side_steps(scene, caster, settings.seed, *lit_by)
            given = sided, caster, settings.seed
            if isinstance(earlier, Earlier):
                kept = KeptDetails(earlier, sided)
                scene, rays = yield from detail_steps(*given, kept.sought)
                scene = kept.joined(scene)
            else:
                scene, rays = yield from detail_steps(*given)
            seconds["details"] = time.perf_counter() - start
            # What was baked of a scene with other details is no part of this bake any more.
            digest = scene.details.digest(scene.lattice_back)
            store.update(details=digest, rays_details=probes + rays)
        else:
            scene = with_details(sided, *places)
    store.update(seconds=seconds, **write_scene(store, scene))
    return scene
