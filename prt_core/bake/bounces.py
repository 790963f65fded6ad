"""The bounce stage of a bake: rounds of gather rays until two halves of them agree.

All points take part in the first rounds, and in later ones those that are still too far off, or
that are in enclosed places which are (see `bounce_error`): a room behind a window takes many rays,
what stands in the open takes few.
"""

import time
from dataclasses import dataclass, field

import numpy as np

from prt_core.bake.bounce_error import LOCAL, bounce_error
from prt_core.bake.coarse import probe_skies
from prt_core.bake.gather import SHIFTS, read_gather
from prt_core.bake.gather_blocks import (
    GATHER,
    GATHER_RAYS,
    MOST_ROUNDS,
    ROUNDS_OF,
    GatherBlocks,
)
from prt_core.bake.stages import BlocksMissing, open_stage
from prt_core.bake.visibility import add_seconds, blocks
from prt_core.runtime.progress import Progress
from prt_core.store import damage_as_error
from prt_core.transport import all_bounces
from prt_core.transport.gather import ROUND
from prt_core.transport.sent import mean_of_channels, sent_of
from prt_core.transport.visibility import received_light

# Rays of all points together at most: where they ended takes 8 GB before it is compressed.
_MOST_RAYS = 1 << 31
# Rounds before the error is measured first, where no earlier bake tells how many are needed.
_FIRST = 2


@dataclass(frozen=True)
class Bounced:
    """What the rays of the bounces came to.

    Attributes
    ----------
    rays, short_rays : int
        From the points; and from what they met, to see who may share it.
    rounds : int
        0 where bounces are too weak to matter.
    error, enclosed : float or None
        As shares of all light, and of that of enclosed places alone (see `BounceError`).
    hidden : float
        Share of the rays that met a place which sees none of its bake points.
    dark_backs : float
        Share of the rays that met a back to which no light gets.
    skipped : dict
        What was not done because the scene does not need it.
    """

    rays: int = 0
    short_rays: int = 0
    rounds: int = 0
    error: float | None = None
    enclosed: float | None = None
    hidden: float = 0.0
    dark_backs: float = 0.0
    skipped: dict = field(default_factory=dict)


def bounce_steps(
    store, scene, cube_map, caster, settings, seconds, emitted=None, pictures=None, here=True,
    memory=None, reuse=None,
):  # fmt: skip
    """Gather rays of a scene into a store; yields `Progress`.

    Parameters
    ----------
    store : BakeStore
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : BakeSettings
    seconds : dict of str -> float
        By stage; added to.
    emitted : (n_points, k) float32, optional
        Directly received light of emitters, under which the error is measured as well.
    pictures : Pictures, optional
        Is told of K while more rays are needed.
    here : bool
        Whether blocks that are missing are computed; otherwise they are said.
    memory : Memory, optional
    reuse : Reuse, optional
        Whose rays are taken where they are as they were.

    Returns
    -------
    Bounced

    Raises
    ------
    BlocksMissing
    """
    n_points = len(scene.points)
    parts = blocks(n_points)
    start = time.perf_counter()
    probes = yield from _probe_light(store, scene, cube_map, parts)
    add_seconds(seconds, "error", time.perf_counter() - start)
    if emitted is not None:
        probes = np.hstack([probes, emitted])
    # What nothing can be in front of gathers nothing.
    skipped = {"gather_open_points": int(scene.open_points.sum())}
    points = scene.points
    bound = _most_bounced(np.maximum(points.albedo, points.mean_albedo), probes, scene.open_points)
    if points.materials.translucency.any():
        # The bound knows nothing of light from behind.
        bound = np.inf
    if bound <= settings.tolerance / 2:
        skipped["bounces_below"] = bound
        for name in (GATHER, GATHER_RAYS, ROUNDS_OF, SHIFTS, "blocked"):
            store.remove(name)
        store.update(rounds=0)
        return Bounced(error=bound, skipped=skipped)
    # Of an even sky a point receives what is not blocked.
    blocked = np.clip(1 - probes[:, 0], 0, 1)
    store.keep("blocked", blocked)
    kept = None if reuse is None else reuse.kept_rays(store, settings.seed)
    work = GatherBlocks.begun(store, scene, cube_map, caster, settings.seed, kept)
    room, most = (memory, store.path.parent), most_rounds(n_points)
    # What another bake needed is there, but for what has changed.
    rounds_of, least = np.zeros(n_points, np.int16), _FIRST
    if kept is not None:
        rounds_of[:] = np.minimum(kept.rounds_of, most)
        least = max(least, int(rounds_of[kept.rounds_of > 0].min(initial=most)))
    rounds, error, more = 0, None, np.ones(n_points, bool)
    seen = scene.points.visible if scene.points.visible.any() else more.copy()
    while more.any() or rounds < rounds_of.max():
        stop = int(rounds_of.max())
        if more.any():
            stop = _next_rounds(rounds, error, settings.tolerance, most) if rounds else least
        rounds_of[more] = np.maximum(rounds_of[more], stop)
        yield from _gather_rounds(store, work, range(rounds, stop), rounds_of, seconds, here)
        rounds, start = stop, time.perf_counter()
        with damage_as_error(store.path, f"'{GATHER}'"):
            halves = tuple(_halves(work.hits, scene, rounds, probes, blocked, settings, *room))
        error = bounce_error(*halves, seen, None if error is None else error.classes)
        # Who has once left the rounds does not come back.
        more = (error.of_points > settings.tolerance) & (rounds_of >= rounds) & (rounds < most)
        yield Progress("bounces", n_points, n_points)
        add_seconds(seconds, "error", time.perf_counter() - start)
        if pictures is not None and more.any() and pictures.is_due():
            gather = read_gather(work.hits, range(rounds), blocked, *room)
            pictures.bounced(gather, error.whole)
    store.keep(ROUNDS_OF, rounds_of)
    counts = work.cut(rounds)
    store.update(rounds=rounds, seconds=seconds)
    cast, short, hidden, *backs = counts[...].sum(axis=(0, 1)).tolist()
    short += work.edge_rays
    skipped["gather_rays"] = n_points * rounds * ROUND - cast
    share = hidden / max(cast, 1)
    dark = sum(backs) / max(cast, 1)
    return Bounced(cast, short, rounds, error.whole, error.enclosed, share, dark, skipped)


def _gather_rounds(store, work, turns, rounds_of, seconds, here):
    """Some rounds of rays, of the points that take part in them; yields `Progress`."""
    n_points, parts = work.hits.shape[0], work.parts
    stage = stage_of(turns)
    work.ask(rounds_of, turns)
    yield Progress("gather", 0, n_points)
    for first in range(0, len(parts), work.group):
        group = range(first, min(first + work.group, len(parts)))
        todo = [(i, turn) for turn in turns for i in group if not work.is_done(i, turn)]
        if todo and not here:
            open_stage(store, stage, len(parts))
            missing = [i for i in range(first, len(parts)) if not work.has(i, turns)]
            raise BlocksMissing(store.path, stage, missing)
        if todo:
            start = time.perf_counter()
            work.compute(todo)
            add_seconds(seconds, "gather", time.perf_counter() - start)
        yield Progress("gather", parts[group[-1]].stop, n_points)


def stage_of(turns):
    """The name of the stage that casts some rounds of rays, told by the last of them."""
    return f"gather{turns.stop}"


def most_rounds(n_points):
    """Rounds of rays that the bounces may take."""
    return min(MOST_ROUNDS, max(2, _MOST_RAYS // (max(n_points, 1) * ROUND) // 2 * 2))


def gather_so_far(store, rounds, memory=None):
    """K (CSR float32) of so many rounds of a bake under way; None where there are none."""
    if not rounds:
        return None
    n_points = store.array(GATHER).shape[0]
    blocked = store.read("blocked", (n_points,), "float32")
    return read_gather(store.array(GATHER), range(rounds), blocked, memory, store.path.parent)


def _next_rounds(rounds, error, tolerance, most):
    """Rounds after which the error should be within the tolerance.

    Errors of rays in a Sobol sequence fall with the 0.7th to 0.75th power of their number. Enclosed
    places take at most twice as many as there are: fewer of them may need the rest.
    """
    whole = error.whole > tolerance
    worst = error.whole if whole else error.enclosed / LOCAL
    wanted = 2 * int(np.ceil(rounds * (worst / tolerance) ** (1 / 0.7) / 2))
    return min(max(wanted, rounds + 2), most if whole else 2 * rounds, most)


def _most_bounced(albedo, probes, spared):
    """An upper bound of the share that all bounces add under the probe lights.

    What a point does not see of an even sky it sees of the scene, at most; no point sends out
    more than the brightest, and all bounces together are a geometric series.
    """
    reflects = albedo.max(axis=1).astype(np.float64)
    gathers = reflects * np.clip(1 - probes[:, 0].astype(np.float64), 0, 1)
    gathers[spared] = 0
    direct = reflects[:, None] * probes
    size = np.sqrt((direct**2).sum(axis=0))
    lit = size > 0
    if not lit.any() or gathers.max() >= 1:
        return 0.0 if not lit.any() else np.inf
    brightest = direct.max(axis=0) / (1 - gathers.max())
    return float((np.sqrt((gathers**2).sum()) * brightest[lit] / size[lit]).max())


def _probe_light(store, scene, cube_map, parts):
    """(n_points, 3) received light of an even sky, a low and a high lamp-like sky."""
    light = probe_skies(cube_map)
    bits = store.array("visibility")
    received = []
    for block in parts:
        normals = scene.points.normals[block]
        received.append(received_light(bits[block], normals, cube_map, light))
        yield Progress("bounces", block.stop, len(scene.points))
    return np.concatenate(received)


def _halves(hits, scene, rounds, probes, blocked, settings, *room):
    """Radiance of all bounces under the probe lights, by two halves of the rays."""
    points = scene.points
    albedo, mean = (
        mean_of_channels(sent_of(materials, scene.opposite))
        for materials in (points.materials, points.mean_materials)
    )
    for half in (0, 1):
        operator = read_gather(hits, range(half, rounds, 2), blocked, *room)
        yield all_bounces(operator, albedo, probes, 1e-4, settings.bounces, mean)[0]
        del operator
