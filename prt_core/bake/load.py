"""A finished bake back into memory, checked: digests of all that is read, and every range."""

import numpy as np

from prt_core.bake.bake import Bake
from prt_core.bake.emission import read_emission
from prt_core.bake.gather import read_gather, stored_hits
from prt_core.bake.gather_blocks import MOST_ROUNDS
from prt_core.bake.gather_file import GatherFile
from prt_core.bake.lights import read_lights
from prt_core.bake.memory import Memory
from prt_core.bake.reflections import read_reflections
from prt_core.bake.settings import BakeSettings
from prt_core.bake.visibility import DENSE, read_visibility
from prt_core.errors import expect
from prt_core.runtime.address import expect_store_path
from prt_core.sphere import CubeMap
from prt_core.store import BakeStore, damage_as_error, read_scene
from prt_core.transport import Transport


def load(path):
    """Read a finished bake.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Bake

    Raises
    ------
    PRTError
        Not there, not finished, damaged, foreign, or of another version.
    """
    path = expect_store_path("bake", path)
    store = BakeStore(path)
    attributes = store.attributes
    expect(
        attributes.get("kind") is None,
        f"{path}: is a {attributes.get('kind')!s:.20}, not a bake; see 'prt lightfield --help'",
    )
    expect(
        store.is_complete,
        f"{path}: the bake is not finished; run the same 'prt bake' again and it goes on",
    )
    scene = read_scene(store)
    with damage_as_error(path):
        settings = BakeSettings(**attributes["settings"])
        cube_map = CubeMap(settings.resolution)
        rounds, report = attributes.get("rounds", 0), attributes["report"]
        expect(
            type(rounds) is int and 0 <= rounds <= MOST_ROUNDS and isinstance(report, dict),
            "the number of its rounds or its report is damaged",
        )
    beside = read_lights(store, cube_map)
    points = scene.points
    n_points, n_bytes = len(points), -(-cube_map.n_directions // 8)
    memory = Memory.of()
    bits = read_visibility(store, (n_points, n_bytes), memory)
    transport = Transport(
        cube_map,
        bits,
        _read_gather(store, n_points, rounds, memory) if rounds else None,
        points.normals,
        points.materials,
        settings.series,
        settings.bounces,
        None if points.mean_materials.equals(points.materials) else points.mean_materials,
        scene.opposite if points.materials.through.any() else None,
    )
    world = beside.world
    texels, image = (None, None) if world is None else (world.texels, world.image)
    said = settings.stored(), report, beside.source, path, beside.origin
    parts = beside.lamps, texels, beside.camera, *said
    emission = read_emission(store, scene, rounds, transport.bounced_albedo)
    reflections = read_reflections(store, scene, cube_map)
    more = _read_dense(store, n_points), emission, reflections, beside.cameras, image
    return Bake(scene, transport, *parts, *more, beside.view_transform)


def _read_dense(store, n_points):
    """The densely sampled points; None where the bake's method has none."""
    if DENSE not in store.attributes["arrays"]:
        return None
    dense = store.read(DENSE, (None,), "int32")
    good = len(dense) and dense[0] >= 0 and dense[-1] < n_points and (np.diff(dense) > 0).all()
    expect(good, f"{store.path}: '{DENSE}' is out of range; the bake is damaged")
    return dense


def _read_gather(store, n_points, rounds, memory):
    """K, read block by block: its rays take more memory than it does."""
    blocked = store.read("blocked", (n_points,), "float32")
    expect(
        bool(((blocked >= 0) & (blocked <= 1)).all()),
        f"{store.path}: 'blocked' is out of range; the bake is damaged",
    )
    with (
        stored_hits(store, n_points, rounds) as hits,
        damage_as_error(store.path, "'gather'"),
    ):
        gather = read_gather(hits, range(rounds), blocked, memory, store.path.parent)
    return gather.mapped() if isinstance(gather, GatherFile) else gather
