"""A bake that others compute: planned, looked through, and closed, by one process at a time.

Planning reads the scene, looks for the backs and places that need points, bakes what shining
surfaces send out (what they look like between their corners only Blender knows), and puts all of
it into the store. Finishing goes as far as the blocks that are there allow.
"""

import numpy as np

from prt_core.bake.emission import EmissionResult, emission_probes, emission_steps
from prt_core.bake.inputs import expect_bake_input, unless_begun
from prt_core.bake.lights import Beside
from prt_core.bake.memory import Memory
from prt_core.bake.settings import BakeSettings
from prt_core.bake.stages import LIGHTS, OPEN, WORK, is_planned, open_stage, open_stages
from prt_core.bake.steps import Begun, begin_steps, rest_steps, stored_seconds
from prt_core.bake.tiled import TILE, TileBlocks
from prt_core.bake.visibility import STAGE, ExhaustiveBlocks, chosen_method
from prt_core.bake.visibility_stage import choose_tile
from prt_core.errors import expect, expect_flag, expect_kind, system_errors
from prt_core.light.environment import expect_radiance
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.machine import return_memory
from prt_core.scene import expect_camera
from prt_core.sphere import CubeMap
from prt_core.store import BakeStore, damage_as_error, read_scene


def plan_steps(
    scene,
    path,
    settings=None,
    lamps=(),
    world=None,
    camera=None,
    source=None,
    lights=None,
    origin=None,
    cameras=None,
    memory=None,
    finished=False,
    view_transform=None,
):
    """Put a scene into a store whose blocks of work are computed apart; yields `Progress`.

    Where the bake was begun, planned or not, it is gone on with; blocks that are there stay.

    Parameters
    ----------
    scene, path, settings, lamps, world, camera, source, lights, origin, cameras
        See `bake_steps`.
    memory : float, optional
        Gigabytes that each of those who compute blocks may take, beside the scene.
    finished : bool
        Whether a bake that is finished is left as it is, without stages, and is no error.
    view_transform
        See `bake_steps`.

    Returns
    -------
    list of Stage
        Those that are known by now (see `blocks.stages`).

    Raises
    ------
    PRTError
        The store holds a bake that is finished, or of another scene or other settings; or the
        method cannot be cut into blocks.
    """
    settings = BakeSettings() if settings is None else settings
    expect_kind("settings", settings, BakeSettings)
    cube_map, memory = CubeMap(settings.resolution), Memory.of(memory)
    camera = None if camera is None else expect_camera(camera)
    given = lamps, world, camera, source, False, None, lights, origin, cameras, view_transform
    world = expect_bake_input(scene, path, cube_map, *given)
    casters = []

    def caster():
        casters.append(scene.make_caster(settings.caster, "diffuse", settings.resolution))
        return casters[0]

    beside = Beside(lamps, world, camera, source, origin, cameras, view_transform)
    try:
        with system_errors(path), unless_begun(path):
            begun = yield from begin_steps(scene, path, settings, beside, False, caster)
            if begun.report is not None:
                expect(finished, f"{path}: the bake is finished; nothing of it is left to plan")
                return []
            place = begun.store.path
            expect(
                place == expect_store_path("bake", path),
                f"{place}: a restart of this bake was stopped here; end it by the same 'prt bake' "
                "without blocks of work, or remove it",
            )
            yield from _planned_steps(begun, cube_map, settings, lights, memory)
            return open_stages(begun.store)
    finally:
        for item in casters:
            item.close()


def _planned_steps(begun, cube_map, settings, lights, memory):
    """What only who has the scene can do, and what is looked for but once."""
    store, scene, caster, seconds = begun.store, begun.scene, begun.caster, begun.seconds
    given = store, scene, cube_map, caster
    method = chosen_method(settings.method, len(scene.points), cube_map.n_directions)
    if not is_planned(store):
        emitted = yield from emission_steps(store, scene, caster, settings, seconds)
        store.keep(OPEN, scene.open_points)
        names = _keep_lights(store, lights) if settings.gloss or method != "exhaustive" else []
        work = {
            "stages": [],
            "caster": caster.name,
            "messages": scene.messages,
            "lights": names,
            "emitted": [emitted.rays, emitted.error, emitted.emitters],
        }
        store.update(seconds=seconds, **{WORK: work})
    choose_tile(store, scene, cube_map, method, memory)
    if not open_stages(store):
        if TILE in store.attributes:
            n_blocks = len(TileBlocks.begun(*given, settings).tiles)
        else:
            n_blocks = len(ExhaustiveBlocks.begun(*given).parts)
        open_stage(store, STAGE, n_blocks)


def finish_steps(path, memory=None, compute=False):
    """Close a planned bake as far as its blocks allow; a generator of `Progress`.

    Parameters
    ----------
    path : str or Path
        `NAME.prt`.
    memory : float, optional
        Gigabytes that may be taken, beside the scene; default: half of what there is.
    compute : bool
        Whether blocks that are missing are computed here.

    Returns
    -------
    dict
        The report (see `bake_steps`); of a bake that is finished already, its own.

    Raises
    ------
    BlocksMissing
        Some are: of a stage that was known, or of one that is open from now on.
    PRTError
        There is no such bake, it was not planned, or it is damaged.
    """
    path, memory = expect_store_path("store", path), Memory.of(memory)
    expect_flag("compute", compute)
    store = BakeStore(path, "r+")
    if store.is_complete:
        with damage_as_error(path):
            return store.attributes["report"]
    expect(
        is_planned(store),
        f"{path}: was not planned for blocks of work; run the same 'prt bake' again and it goes on",
    )
    store.take_all()
    with damage_as_error(path):
        settings = BakeSettings(**store.attributes["settings"])
        work = dict(store.attributes[WORK])
        rays, error, emitters = work["emitted"]
        cube_map = CubeMap(settings.resolution)
        scene = read_scene(store)
        scene.messages[:] = map(str, work["messages"])
        lights = _read_lights(store, work["lights"], cube_map)
    return_memory()
    scene.open_points = store.read(OPEN, (len(scene.points),), "bool")
    emitted = EmissionResult()
    if scene.emitters:
        emitted = EmissionResult(rays, error, emitters, emission_probes(store))
    caster = scene.make_caster(work["caster"], "diffuse", settings.resolution)
    try:
        with system_errors(path):
            begun = Begun(store, scene, caster, stored_seconds(store), resumed=True)
            return (
                yield from rest_steps(
                    begun, cube_map, settings, lights, emitted=emitted, here=compute, memory=memory
                )
            )
    finally:
        caster.close()


def _keep_lights(store, lights):
    """Put the lights of the certificate into a store; returns their names."""
    lights = (lights() if callable(lights) else lights) or {}
    if lights:
        store.keep(LIGHTS, np.stack([np.asarray(x, np.float32) for x in lights.values()]))
    return list(lights)


def _read_lights(store, names, cube_map):
    """Name -> (n_directions, 3) float32; None where there are none."""
    if not names:
        return None
    stored = store.read(LIGHTS, (len(names), cube_map.n_directions, 3), "float32")
    return {
        str(name): expect_radiance(f"light '{name}'", light, cube_map)
        for name, light in zip(names, stored, strict=True)
    }
