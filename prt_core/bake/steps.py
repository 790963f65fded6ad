"""The bake: visibility and gather rays of a scene, block by block into a store."""

import time

from prt_core.bake.bounces import Bounced, bounce_steps, gather_so_far
from prt_core.bake.earlier import details_of, earlier_bake, expect_objects, taken
from prt_core.bake.emission import bounced_emission_steps, emission_steps, read_direct
from prt_core.bake.gloss_certificate import gloss_certificate_steps
from prt_core.bake.inputs import expect_bake_input, unless_begun
from prt_core.bake.lights import keep_lights, light_attributes
from prt_core.bake.pictures import Pictures
from prt_core.bake.reflections import reflection_steps
from prt_core.bake.report import bake_report
from prt_core.bake.reuse import Reuse, note_reuse, reuse_of
from prt_core.bake.settings import BakeSettings
from prt_core.bake.visibility import chosen_method, visibility_steps
from prt_core.errors import expect, expect_kind, expect_number, system_errors
from prt_core.rays import RelayCaster
from prt_core.runtime.main_thread import MainThreadCalls, steps_in_thread
from prt_core.runtime.progress import STOP, Progress
from prt_core.scene import expect_camera, with_details
from prt_core.sphere import CubeMap
from prt_core.store import (
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
    reuse=None,
    only=None,
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
    world : (n_directions, 3) float32, optional
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
        Kept with the bake: the `file` (seen from the bake's folder) and the `scene` it is of.
    cameras : dict of str -> Camera, optional
        Kept with the bake: all cameras of the scene by name, for views.
    pictures : Pictures, optional
        Is told what is known while the bake runs, and hands it out; the bake is the same.
    reuse : str or Path, optional
        An earlier bake of the scene, which may be the one at `path`: what a change cannot have
        touched is taken from it. Where nothing can be, the report says why.
    only : sequence of str, optional
        With `reuse`: objects whose points are asked again; those of others stay as they were.

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
    given = lamps, world, camera, source, restart, pace, lights, origin, cameras
    world = expect_bake_input(scene, path, cube_map, *given)
    if pictures is not None:
        expect_kind("pictures", pictures, Pictures)
    expect(only is None or reuse is not None, "only: changes nothing without reuse")
    if only is not None:
        expect_objects(scene, only)
    casters = []

    def caster():
        casters.append(scene.make_caster(settings.caster, "diffuse", settings.resolution))
        return casters[0]

    parts = (lamps, world, camera, source, origin, cameras)
    try:
        with system_errors(path), unless_begun(path):
            given = scene, path, settings, parts, restart, lights, pictures, reuse, only
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
    scene, path, settings, parts, restart, lights, pictures, reuse, only, new_caster, pace=None
):  # fmt: skip
    """`bake_steps`, with a function that makes the caster once rays are needed."""
    cube_map = CubeMap(settings.resolution)
    check_scene(scene)
    attributes, world = light_attributes(*parts)
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
            keep_lights(store, attributes, world)
            with damage_as_error(path):
                return finish_bake(store, path).attributes["report"]
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
    with damage_as_error(path):
        seconds = {
            stage: expect_number(f"seconds of {stage}", value, least=0)
            for stage, value in store.attributes.get("seconds", {}).items()
        }
    if pictures is not None:
        method = chosen_method(settings.method, len(scene.points), cube_map.n_directions)
        parts = parts[0], world, *parts[2:]
        pictures.begin(scene, cube_map, settings, caster, parts, method == "exhaustive")
        yield Progress("scene", 0, 0)
    scene = yield from _detailed(store, scene, caster, settings, parts, seconds, earlier)
    if pictures is not None:
        pictures.detailed(scene)
    keep_lights(store, attributes, world)
    yield Progress("scene", 0, 0)
    reuse = reuse_of(earlier, scene, only)
    part = reuse if isinstance(reuse, Reuse) else None
    seen = yield from visibility_steps(
        store, scene, cube_map, caster, settings, lights, seconds, pace, pictures, part
    )
    reflected = yield from reflection_steps(store, scene, cube_map, caster, settings, seconds)
    emitted = yield from emission_steps(store, scene, caster, settings, seconds)
    certified = yield from gloss_certificate_steps(
        store, scene, cube_map, caster, settings, lights, seconds
    )
    if pictures is not None and scene.emitters:
        pictures.emitted(read_direct(store))
    bounced = Bounced()
    if settings.bounces != 0:
        work = store, scene, cube_map, caster, settings, seconds, emitted.probes, pictures, part
        bounced = yield from bounce_steps(*work)
    if pictures is not None and pictures.to_the_end:
        with damage_as_error(path):
            gather = gather_so_far(store, bounced.rounds)
            pictures.finished(lambda: store.array("visibility")[...], gather, bounced.error or 0.0)
    yield from bounced_emission_steps(store, scene, bounced.rounds, settings, seconds)
    with damage_as_error(path):
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
    if resumed:
        report["messages"].append("the bake was stopped and went on: times are those since then")
        # Some of the rays were cast before the clock was started.
        report["rays_per_second"] = None
    note_reuse(store, report, reuse)
    store.seal(report=report, seconds=seconds)
    finish_bake(store, path)
    return report


def _detailed(store, scene, caster, settings, parts, seconds, earlier):
    """The scene with points on backs, and hidden ones in gaps and rooms within a face, stored.

    They are found by rays: what goes on takes those that it began with, where they are whole.
    """
    if settings.bounces != 0:
        sided = read_backs(store, scene)
        places = None if sided is None else read_details(store, sided)
        if places is None:
            start, (lamps, _, camera, *_) = time.perf_counter(), parts
            sided, probes = yield from side_steps(scene, caster, settings.seed, lamps, camera)
            scene, rays = yield from detail_steps(sided, caster, settings.seed)
            scene = details_of(earlier, sided, scene)
            seconds["details"] = time.perf_counter() - start
            # What was baked of a scene with other details is no part of this bake any more.
            digest = scene.details.digest(scene.lattice_back)
            store.update(details=digest, rays_details=probes + rays)
        else:
            scene = with_details(sided, *places)
    store.update(seconds=seconds, **write_scene(store, scene))
    return scene
