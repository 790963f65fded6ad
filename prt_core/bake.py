"""The bake: visibility and gather rays of a scene, block by block into a store, and back."""

import os
import platform
import time
from dataclasses import asdict, dataclass, field

import numpy as np
import scipy.sparse as sp

import prt_core
from prt_core.errors import PRTError, expect
from prt_core.light import CubeMap, Lamp
from prt_core.machine import peak_bytes
from prt_core.progress import Pace, Progress, beside, maybe_beside
from prt_core.rays import make_caster
from prt_core.scene import Scene
from prt_core.store import BakeStore, read_scene, write_scene
from prt_core.transport import (
    Transport,
    all_bounces,
    gather_operator,
    gather_steps,
    visibility_bits,
)
from prt_core.transport.gather import ROUND
from prt_core.transport.visibility import received_light

BLOCK = 2048
_MOST_ROUNDS = 8
# Seconds that a stop may have to wait for threads.
_STOP = 0.1


@dataclass(frozen=True)
class BakeSettings:
    """What a bake depends on besides the scene.

    Parameters
    ----------
    resolution : int
        Texels along an edge of the cube map.
    bounces : int or None
        None: all that matter; 0: direct light only.
    tolerance : float
        Relative error of the relit colours that the bounces may have.
    caster : str
        `auto`, `blender`, `bvhtree`, `embree` or `brute`.
    seed : int
    """

    resolution: int = 32
    bounces: int | None = None
    tolerance: float = 1e-2
    caster: str = "auto"
    seed: int = 0

    def __post_init__(self):
        CubeMap(self.resolution)
        expect(
            self.bounces is None or (isinstance(self.bounces, int) and self.bounces >= 0),
            f"bounces: expected 'auto' or a whole number >= 0, got {self.bounces!r}",
        )
        expect(
            np.isfinite(self.tolerance) and 0 < self.tolerance < 1,
            f"tolerance: expected a number between 0 and 1, got {self.tolerance}",
        )


@dataclass
class Bake:
    """A bake in memory.

    Attributes
    ----------
    scene : Scene
    transport : Transport
    lamps : list of Lamp
        The lamps the scene had.
    world : (n_directions, 3) float32, or None
        The light of the scene's world, where it was understood.
    camera : dict, or None
    settings, report : dict
    source : dict of str -> str
        Digests of the meshes the bake was made from.
    """

    scene: Scene
    transport: Transport
    lamps: list
    world: np.ndarray | None
    camera: dict | None
    settings: dict
    report: dict
    source: dict = field(default_factory=dict)

    @property
    def cube_map(self):
        return self.transport.cube_map

    def make_caster(self, name="auto"):
        """A ray caster over the bake's triangles, for lamps and pictures."""
        return make_caster(name, self.scene.vertices, self.scene.triangles)

    def colours(self, radiance):
        """Radiance of points as colours of corners.

        Parameters
        ----------
        radiance : (n_points, 3) float32

        Returns
        -------
        dict of str -> (n_corners, 3) float32
            For each object that receives, in Blender's loop order; black for corners of faces
            without area.
        """
        return {
            item.name: np.where(
                item.corner_point[:, None] >= 0, radiance[item.corner_point], np.float32(0)
            )
            for item in self.scene.objects
            if item.receives
        }


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
):
    """Bake a scene into a store; a generator of `Progress` (see `progress.run`).

    A store that is there and unfinished is gone on with; a finished one of the same scene and
    settings is left as it is.

    Parameters
    ----------
    scene : Scene
    path : str or Path
        `NAME.prt`, a folder.
    settings : BakeSettings
    lamps : sequence of Lamp, world : (n_directions, 3) float32, camera : dict
        Kept with the bake for relighting and pictures.
    source : dict of str -> str
        Kept with the bake: the digest of each mesh it was made from (see `mesh_digests`).
    restart : bool or "changed"
        Begin anew whatever is there; or only where that is of another scene or other settings.
    pace : float, optional
        Seconds a step may take, for a user interface; default: whole blocks. The result is the
        same.

    Returns
    -------
    dict
        The report: points, directions, back_end, rays, seconds by stage, bytes, peak_bytes,
        error, messages.

    Raises
    ------
    PRTError
        The store belongs to another scene or other settings, or is no bake.
    """
    settings = settings or BakeSettings()
    cube_map = CubeMap(settings.resolution)
    store = BakeStore(path, "w" if restart is True else "a")
    identity = {
        "scene": (yield from beside("scene", scene.fingerprint)),
        **{k: v for k, v in asdict(settings).items() if k != "caster"},
    }
    facts = store.facts
    if restart == "changed" and facts.get("identity", identity) != identity:
        store = BakeStore(path, "w")
        facts = store.facts
    if "identity" in facts:
        _same_bake(path, facts["identity"], identity)
    if facts.get("complete"):
        _write_lights(store, lamps, world, camera, source)
        return facts["report"]
    caster = make_caster(settings.caster, scene.vertices, scene.triangles)
    try:
        _write_lights(store, lamps, world, camera, source)
        if "identity" not in facts:
            yield from beside("scene", write_scene, store, scene)
            store.update(settings=asdict(settings), identity=identity)
        seconds = dict(facts.get("seconds", {}))
        rays = yield from _bake_visibility(store, scene, cube_map, caster, seconds, pace)
        gathered, error, rounds = 0, None, 0
        if settings.bounces != 0:
            gathered, error, rounds = yield from _bake_gather(
                store, scene, cube_map, caster, settings, seconds, pace
            )
    finally:
        caster.close()
    report = _report(scene, cube_map, caster, rays, gathered, rounds, error, seconds, store)
    store.update(report=report, complete=True)
    report["bytes"] = store.nbytes()
    store.update(report=report)
    return report


def _write_lights(store, lamps, world, camera, source):
    """Lamps, world and camera may change without any ray being cast again."""
    if world is not None:
        store.write("world", np.asarray(world, np.float32))
    store.update(lamps=[asdict(lamp) for lamp in lamps], camera=camera, source=source or {})


def _same_bake(path, found, wanted):
    different = sorted(key for key in wanted if found.get(key) != wanted[key])
    if different:
        raise PRTError(
            f"{path}: holds a bake with another {', '.join(different)}; choose another output "
            "or add --restart to replace it"
        )


def _blocks(n_points):
    return [slice(f, min(f + BLOCK, n_points)) for f in range(0, n_points, BLOCK)]


def _bake_visibility(store, scene, cube_map, caster, seconds, pace):
    n_points = len(scene.points)
    n_bytes = -(-cube_map.n_directions // 8)
    blocks = _blocks(n_points)
    # No real row has every bit set, so no chunk is left out for being equal to the fill.
    bits = store.create("visibility", (n_points, n_bytes), "uint8", (BLOCK, n_bytes), 255)
    counts = store.create("visibility_rays", (len(blocks),), "int64", (1,), -1)
    yield Progress("visibility", 0, n_points)
    # A caster that threads may call works beside its caller, in parts that a stop waits for.
    threaded = pace is not None and caster.threads > 1
    pace = Pace(_STOP if threaded else pace)
    for index, block in enumerate(blocks):
        if not (store.has_chunk("visibility", index, 0) and store.has_chunk(counts.name, index)):
            start, tally = time.perf_counter(), []
            traced = np.empty((block.stop - block.start, n_bytes), np.uint8)
            for part in pace.parts(block.start, block.stop):
                inside = slice(part.start - block.start, part.stop - block.start)
                work = (visibility_bits, scene, cube_map, caster, part, tally.append)
                traced[inside] = yield from maybe_beside(threaded, "visibility", *work)
                pace.worked()
                yield Progress("visibility", part.stop, n_points)
            counts[index] = sum(tally)
            bits[block] = traced
            _add(store, seconds, "visibility", time.perf_counter() - start)
        yield Progress("visibility", block.stop, n_points)
    return int(counts[...].sum())


def _add(store, seconds, stage, spent):
    seconds[stage] = seconds.get(stage, 0.0) + spent
    store.update(seconds=seconds)


def _bake_gather(store, scene, cube_map, caster, settings, seconds, pace):
    n_points = len(scene.points)
    blocks = _blocks(n_points)
    shape, chunks = (n_points, _MOST_ROUNDS * ROUND), (BLOCK, ROUND)
    # Point -2 is never hit, so that no chunk is left out for being equal to the fill.
    hits = store.create("gather", shape, "int32", chunks, -2)
    table = (_MOST_ROUNDS, len(blocks), 1 + len(scene.objects))
    counts = store.create("gather_rays", table, "int64", (1, 1, table[2]), -1)
    start = time.perf_counter()
    probes = yield from _probe_light(store, scene, cube_map, blocks)
    _add(store, seconds, "error", time.perf_counter() - start)
    rounds, error, pace = 0, np.inf, Pace(pace, 4096)
    while rounds < _MOST_ROUNDS and error > settings.tolerance:
        rounds += 2
        yield Progress("gather", 0, n_points)
        for index, block in enumerate(blocks):
            for turn in (rounds - 2, rounds - 1):
                done = store.has_chunk("gather", index, turn)
                if not (done and store.has_chunk("gather_rays", turn, index, 0)):
                    start, tally = time.perf_counter(), []
                    found, back = yield from gather_steps(
                        scene, caster, block, settings.seed, turn, tally.append, pace
                    )
                    counts[turn, index] = np.concatenate([[sum(tally)], back])
                    hits[block, turn * ROUND : (turn + 1) * ROUND] = found
                    _add(store, seconds, "gather", time.perf_counter() - start)
            yield Progress("gather", block.stop, n_points)
        start = time.perf_counter()
        error = yield from beside("bounces", _bounce_error, hits, scene, rounds, probes, settings)
        _add(store, seconds, "error", time.perf_counter() - start)
    store.update(rounds=rounds)
    return int(counts[:rounds, :, 0].sum()), float(error), rounds


def _probe_light(store, scene, cube_map, blocks):
    """(n_points, 3) received light of an even sky, a low and a high lamp-like sky."""
    directions = cube_map.directions
    towards = np.array([[0.8, 0.3, 0.52], [-0.5, -0.7, 0.51]])
    light = np.ones((cube_map.n_directions, 3), np.float32)
    light[:, 1:] = np.exp(12 * (directions @ towards.T - 1))
    bits = store.array("visibility")
    received = []
    for block in blocks:
        normals = scene.points.normals[block]
        received.append(received_light(bits[block], normals, cube_map, light))
        yield Progress("bounces", block.stop, len(scene.points))
    return np.concatenate(received)


def _bounce_error(hits, scene, rounds, probes, settings):
    """Relative error of all bounces, from two halves of the rays, worst of the probe lights."""
    halves = []
    albedo = scene.points.albedo.mean(axis=1, keepdims=True)
    for half in (0, 1):
        operator = read_gather(hits, range(half, rounds, 2), len(scene.points))
        halves.append(all_bounces(operator, albedo, probes, 1e-4, settings.bounces)[0])
        del operator
    seen = scene.points.visible
    if not seen.any():
        seen = ~seen
    first, second = (half[seen].astype(np.float64) for half in halves)
    spread = np.sqrt(((first - second) ** 2).sum(axis=0)) / 2
    size = np.sqrt((((first + second) / 2) ** 2).sum(axis=0))
    return float((spread / np.maximum(size, 1e-30)).max()) if size.any() else 0.0


def read_gather(hits, rounds, n_points):
    """K (CSR float32) from the stored hits of some rounds, block by block."""
    rounds = list(rounds)
    parts = []
    for block in _blocks(n_points):
        chunk = hits[block, : (rounds[-1] + 1) * ROUND].reshape(block.stop - block.start, -1, ROUND)
        chunk = chunk[:, rounds].reshape(len(chunk), -1)
        expect(
            chunk.min() >= -1 and chunk.max() < n_points,
            "gather: a hit names a point that does not exist; the bake is damaged",
        )
        parts.append(gather_operator(chunk, n_points))
    return sp.vstack(parts, format="csr") if len(parts) > 1 else parts[0]


def _report(scene, cube_map, caster, rays, gathered, rounds, error, seconds, store):
    messages = list(scene.messages)
    if rounds:
        back = store.array("gather_rays")[:rounds, :, 1:].sum(axis=(0, 1))
        for item, count in zip(scene.objects, back, strict=True):
            if count > 0.02 * gathered:
                messages.append(
                    f"{item.name}: {count / gathered:.1%} of the bounce rays met its back, which "
                    f"returns no light; if it is a sheet, bake with --two-sided '{item.name}'"
                )
    traced = sum(seconds.get(stage, 0) for stage in ("visibility", "gather"))
    return {
        "points": len(scene.points),
        "hidden_points": int((~scene.points.visible).sum()),
        "triangles": len(scene.triangles),
        "directions": cube_map.n_directions,
        "back_end": caster.name,
        "rays": rays + gathered,
        "rays_visibility": rays,
        "rays_gather": gathered,
        "rays_per_second": (rays + gathered) / max(traced, 1e-9),
        "rays_a_point": rounds * ROUND,
        "error": error,
        "seconds": {stage: round(value, 3) for stage, value in seconds.items()},
        "bytes": 0,
        "peak_bytes": peak_bytes(),
        "cores": os.cpu_count(),
        "versions": {
            "prt_core": prt_core.__version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
        "messages": messages,
    }


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
        Not there, not finished, damaged, foreign, or of a newer version.
    """
    store = BakeStore(path)
    facts = store.facts
    expect(
        facts.get("complete") is True,
        f"{path}: the bake is not finished; run the same 'prt bake' again and it goes on",
    )
    scene = read_scene(store)
    try:
        settings = facts["settings"]
        cube_map = CubeMap(settings["resolution"])
        lamps = [Lamp(**lamp) for lamp in facts["lamps"]]
        rounds, report = facts.get("rounds", 0), facts["report"]
        camera = facts["camera"]
        bounces, tolerance = settings["bounces"], float(settings["tolerance"])
    except (KeyError, TypeError) as error:
        raise PRTError(f"{path}: its description is damaged ({error!r})") from error
    n_points, n_bytes = len(scene.points), -(-cube_map.n_directions // 8)
    bits = store.read("visibility", (n_points, n_bytes), "uint8")
    gather = None
    if rounds:
        hits = store.array("gather")
        expect(
            hits.shape == (n_points, _MOST_ROUNDS * ROUND) and 0 < rounds <= _MOST_ROUNDS,
            f"{path}: 'gather' does not fit its points; the bake is damaged",
        )
        try:
            gather = read_gather(hits, range(rounds), n_points)
        except PRTError as error:
            raise PRTError(f"{path}: {error}") from error
        except Exception as error:
            raise PRTError(
                f"{path}: 'gather' cannot be read; the bake is damaged, bake again with --restart"
            ) from error
    world = None
    if "world" in store:
        world = store.read("world", (cube_map.n_directions, 3), "float32")
    transport = Transport(
        cube_map,
        bits,
        gather,
        scene.points.normals,
        scene.points.albedo,
        min(tolerance / 5, 1e-3),
        bounces,
    )
    return Bake(scene, transport, lamps, world, camera, settings, report, facts.get("source") or {})
