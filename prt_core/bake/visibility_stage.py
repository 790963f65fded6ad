"""The visibility stage of a bake: every entry traced, or few of them and the error known."""

from prt_core.bake.sampled import sample_arrays, sampled_steps
from prt_core.bake.stages import is_planned
from prt_core.bake.tile_rows import TileArrays
from prt_core.bake.tiled import METHOD, TILE, tiled_steps
from prt_core.bake.visibility import (
    DENSE,
    STAGE,
    add_seconds,
    chosen_method,
    exhaustive_steps,
)
from prt_core.errors import PRTError, expect
from prt_core.store import JournalMismatch, RayJournal


def visibility_steps(
    store, scene, cube_map, caster, settings, lights, seconds, pace, pictures=None, here=True,
    memory=None, reuse=None,
):  # fmt: skip
    """Visibility of a scene into a store; yields `Progress`; `pictures` are told of it.

    Parameters
    ----------
    store : BakeStore
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : BakeSettings
    lights : dict of str -> (n_directions, 3) float32, callable() -> dict, or None
    seconds : dict of str -> float
        By stage; added to.
    pace, pictures
        See `bake_steps`.
    here : bool
        Whether blocks that are missing are computed; otherwise they are said.
    memory : Memory
    reuse : Reuse, optional
        What it knows of it is not asked.

    Returns
    -------
    dict
        For the report: method, rays, entries_percent, hemisphere_percent, traced_percent by
        object, certificate, visibility_error, tolerance_met, skipped.

    Raises
    ------
    BlocksMissing
    """
    method = chosen_method(settings.method, len(scene.points), cube_map.n_directions)
    if method == "exhaustive":
        work = store, scene, cube_map, caster, seconds, pace, pictures, here, reuse
        rays = yield from exhaustive_steps(*work)
        store.update(seconds=seconds)
        _show_all(store, pictures, memory)
        entries = len(scene.points) * cube_map.n_directions
        return {
            "method": method,
            "rays": rays,
            "entries_percent": 100 * rays / max(entries, 1),
            "hemisphere_percent": 100.0,
            "certificate": [],
            "visibility_error": 0.0,
            "tolerance_met": True,
            "sampling": {},
        }
    attributes = store.attributes.get("sampled")
    shape = len(scene.points), -(-cube_map.n_directions // 8)
    if attributes is not None and not (
        _holds_samples(store, shape) and _holds_dense(store, attributes)
    ):
        # A block of sampled bits hangs on others: it cannot be made again alone.
        attributes = None
    if attributes is None:
        choose_tile(store, scene, cube_map, method, memory)
    while attributes is None:
        given = settings, lights, pace
        if TILE in store.attributes:
            more = pictures, here, memory, reuse
            steps = tiled_steps(store, scene, cube_map, caster, *given, *more)
        else:
            journal = RayJournal(caster, store)
            more = pictures, reuse
            steps = sampled_steps(store, scene, cube_map, journal, method, *given, *more)
        try:
            attributes, spent = yield from steps
        except JournalMismatch:
            # Written by another version, or on a machine that rounds otherwise: begin anew.
            continue
        for stage, value in spent.items():
            add_seconds(seconds, stage, value)
        store.update(sampled=attributes, seconds=seconds)
    RayJournal.clear(store)
    TileArrays.remove(store)
    _show_all(store, pictures, memory)
    return attributes


def comes_in_blocks(settings, n_points, cube_map, memory):
    """Whether whole rows of some points are known before anything is of the others."""
    method = chosen_method(settings.method, n_points, cube_map.n_directions)
    size = memory.tile_points(n_points, -(-cube_map.n_directions // 8))
    return method == "exhaustive" or (method == METHOD and size < n_points)


def choose_tile(store, scene, cube_map, method, memory):
    """Say in a store how many points a tile has: once, for what is sampled depends on it.

    What is sampled in one piece says nothing of tiles, but where its blocks are planned.
    """
    if TILE in store.attributes or method == "exhaustive":
        return
    planned = is_planned(store)
    n_points = len(scene.points)
    if method != METHOD:
        expect(
            not planned,
            f"method: '{method}' looks at all of a scene to choose where it looks; plan a bake "
            f"with auto, exhaustive or {METHOD}",
        )
        return
    size = memory.tile_points(n_points, -(-cube_map.n_directions // 8))
    if planned or size < n_points:
        store.update(**{TILE: size})


def _show_all(store, pictures, memory):
    bits = store.array(STAGE)
    if pictures is not None and memory.holds(bits.shape[0] * bits.shape[1]):
        pictures.visible(bits.shape[0] * bits.shape[1], lambda: bits[...])


def _holds_samples(store, shape):
    return all(array.holds(slice(0, shape[0])) for array in sample_arrays(store, shape))


def _holds_dense(store, attributes):
    """Whether the dense points are there, where the sampler had any; they are used from then on."""
    try:
        return attributes.get("dense") is None or len(store.read(DENSE)) == attributes["dense"]
    except PRTError:
        return False
