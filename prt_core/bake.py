"""The bake: visibility and gather rays of a scene, block by block into a store, and back."""

import os
import platform
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

import prt_core
from prt_core.bake_bounces import MOST_ROUNDS, bounce_steps, read_gather
from prt_core.bake_visibility import expect_method, visibility_steps
from prt_core.errors import PRTError, expect
from prt_core.light import CubeMap, Lamp
from prt_core.machine import peak_bytes
from prt_core.progress import STOP, Errands, Progress, steps_beside
from prt_core.rays import RelayCaster, make_caster
from prt_core.scene import Scene
from prt_core.store import BakeStore, read_scene, write_scene
from prt_core.transport import Transport
from prt_core.transport.gather import ROUND


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
        Relative error of the relit colours that the bounces may have, and that the visibility may
        have where it is sampled.
    caster : str
        `auto`, `blender`, `bvhtree`, `embree` or `brute`.
    seed : int
    method : str
        Which entries are traced: `exhaustive` (all), `agreement`, another registered sampler, or
        `auto`: the cheapest that meets the tolerance.
    """

    resolution: int = 32
    bounces: int | None = None
    tolerance: float = 1e-2
    caster: str = "auto"
    seed: int = 0
    method: str = "auto"

    def __post_init__(self):
        CubeMap(self.resolution)
        expect_method(self.method)
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
    path : Path, or None
        Where it was loaded from.
    origin : dict of str -> str
        The `file` (seen from the bake's folder) and the `scene` it is of; empty where not known.
    """

    scene: Scene
    transport: Transport
    lamps: list
    world: np.ndarray | None
    camera: dict | None
    settings: dict
    report: dict
    source: dict = field(default_factory=dict)
    path: Path | None = None
    origin: dict = field(default_factory=dict)

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

    def image(self, radiance):
        """The image that was baked: (height, width, 3) float32, linear.

        Parameters
        ----------
        radiance : (n_points, 3) float32

        Raises
        ------
        PRTError
            The bake has no image.
        """
        expect(
            self.scene.image is not None,
            "image: this bake holds none; bake with --camera-pixels or --geometry-image",
        )
        return self.scene.image.pixels(radiance)


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
        Seconds a step may take, for a user interface; then the work is done beside the caller, in
        a thread, but for rays that only the caller may cast. Default: whole blocks. The result is
        the same.
    lights : dict of str -> (n_directions, 3) float32, optional
        Under which the sampled visibility must be within the tolerance; default: an even sky and
        two soft suns.
    origin : dict of str -> str, optional
        Kept with the bake: the `file` (seen from the bake's folder) and the `scene` it is of.

    Returns
    -------
    dict
        The report: points, directions, back_end, rays, seconds by stage, bytes, peak_bytes,
        error (of the bounces), method, entries_percent, certificate, visibility_error,
        tolerance_met, skipped, messages.

    Raises
    ------
    PRTError
        The store belongs to another scene or other settings, or is no bake.
    """
    settings = settings or BakeSettings()
    made = []

    def caster():
        made.append(make_caster(settings.caster, scene.vertices, scene.triangles))
        return made[0]

    parts = (lamps, world, camera, source, origin)
    try:
        if pace is None:
            return (yield from _bake(scene, path, settings, parts, restart, lights, caster))
        errands = Errands()

        def relayed():
            # Threaded rays are cast where the work is, and a stop waits for a part of them.
            found = errands.call(caster)
            return found if found.threads > 1 else RelayCaster(found, errands, pace)

        work = _bake(scene, path, settings, parts, restart, lights, relayed, STOP)
        return (yield from steps_beside(work, errands, "scene"))
    finally:
        for item in made:
            item.close()


def _bake(scene, path, settings, parts, restart, lights, new_caster, pace=None):
    """`bake_steps`, with a function that makes the caster once rays are needed."""
    cube_map = CubeMap(settings.resolution)
    store = BakeStore(path, "w" if restart is True else "a")
    identity = {
        "scene": scene.fingerprint(),
        **{k: v for k, v in asdict(settings).items() if k != "caster"},
    }
    yield Progress("scene", 0, 0)
    facts = store.facts
    if restart == "changed" and facts.get("identity", identity) != identity:
        store = BakeStore(path, "w")
        facts = store.facts
    if "identity" in facts:
        _same_bake(path, facts["identity"], identity)
    if facts.get("complete"):
        _write_lights(store, *parts)
        return facts["report"]
    caster = new_caster()
    _write_lights(store, *parts)
    if "identity" not in facts:
        write_scene(store, scene)
        store.update(settings=asdict(settings), identity=identity)
        yield Progress("scene", 0, 0)
    seconds = dict(facts.get("seconds", {}))
    seen = yield from visibility_steps(
        store, scene, cube_map, caster, settings, lights, seconds, pace
    )
    gathered, error, rounds, skipped = 0, None, 0, {}
    if settings.bounces != 0:
        gathered, error, rounds, skipped = yield from bounce_steps(
            store, scene, cube_map, caster, settings, seconds
        )
    report = _report(
        scene, cube_map, caster, seen, gathered, rounds, error, skipped, seconds, store
    )
    store.update(report=report, complete=True)
    report["bytes"] = store.nbytes()
    store.update(report=report)
    return report


def _write_lights(store, lamps, world, camera, source, origin):
    """Lamps, world and camera may change without any ray being cast again."""
    if world is not None:
        store.write("world", np.asarray(world, np.float32))
    kept = store.facts.get("origin") or origin  # whoever began a bake has it
    store.update(
        lamps=[asdict(lamp) for lamp in lamps], camera=camera, source=source or {}, origin=kept
    )


def _same_bake(path, found, wanted):
    # Before there were others, every entry was traced.
    found = {"method": "exhaustive", **found}
    different = sorted(key for key in wanted if found.get(key) != wanted[key])
    if different:
        raise PRTError(
            f"{path}: holds a bake with another {', '.join(different)}; choose another output "
            "or add --restart to replace it"
        )


def _spared(scene, cube_map, seen):
    """What was not done because the scene does not need it."""
    found = {}
    facts = seen["sampling"]
    if facts:
        found["visibility_rays"] = facts["hemisphere_entries"] - seen["rays"]
        found["open_points"] = facts.get("open_points", 0)
    albedo = scene.points.albedo
    if (albedo == albedo[:, :1]).all():
        found["grey"] = True
    return found


def _report(scene, cube_map, caster, seen, gathered, rounds, error, skipped, seconds, store):
    messages = list(scene.messages)
    if rounds:
        back = store.array("gather_rays")[:rounds, :, 1:].sum(axis=(0, 1))
        for item, count in zip(scene.objects, back, strict=True):
            share = count / (len(scene.points) * rounds * ROUND)
            if share > 0.02:
                messages.append(
                    f"{item.name}: {share:.1%} of the bounce rays met its back, which "
                    f"returns no light; if it is a sheet, bake with --two-sided '{item.name}'"
                )
    traced = sum(seconds.get(stage, 0) for stage in ("visibility", "certificate", "gather"))
    rays = seen["rays"]
    if not seen["tolerance_met"]:
        messages.append(
            f"the visibility may be {seen['visibility_error']:.2%} off in relit colours, more "
            "than the tolerance; bake with --method exhaustive"
        )
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
        **{key: value for key, value in seen.items() if key != "rays"},
        "skipped": {**_spared(scene, cube_map, seen), **skipped},
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
            hits.shape == (n_points, MOST_ROUNDS * ROUND) and 0 < rounds <= MOST_ROUNDS,
            f"{path}: 'gather' does not fit its points; the bake is damaged",
        )
        try:
            blocked = store.read("blocked", (n_points,), "float32")
            gather = read_gather(hits, range(rounds), blocked)
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
    source, origin = facts.get("source") or {}, facts.get("origin") or {}
    parts = (lamps, world, camera, settings, report, source, Path(path), origin)
    return Bake(scene, transport, *parts)
