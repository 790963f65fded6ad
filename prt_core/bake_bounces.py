"""The bounce stage of a bake: rounds of gather rays until two halves of them agree."""

import time

import numpy as np
import scipy.sparse as sp

from prt_core import bake_visibility
from prt_core.bake_visibility import add_seconds, blocks
from prt_core.errors import expect
from prt_core.progress import Pace, Progress, beside
from prt_core.sampling import open_points
from prt_core.transport import all_bounces, gather_operator, gather_steps
from prt_core.transport.gather import ROUND
from prt_core.transport.visibility import received_light

MOST_ROUNDS = 8


def bounce_steps(store, scene, cube_map, caster, settings, seconds, pace):
    """Gather rays of a scene into a store; yields `Progress`.

    Returns
    -------
    rays : int
    error : float
    rounds : int
        0 where bounces are too weak to matter.
    skipped : dict
        What was not done because the scene does not need it.
    """
    n_points = len(scene.points)
    parts = blocks(n_points)
    shape, chunks = (n_points, MOST_ROUNDS * ROUND), (bake_visibility.BLOCK, ROUND)
    # Point -2 is never hit, so that no chunk is left out for being equal to the fill.
    hits = store.create("gather", shape, "int32", chunks, -2)
    table = (MOST_ROUNDS, len(parts), 1 + len(scene.objects))
    counts = store.create("gather_rays", table, "int64", (1, 1, table[2]), -1)
    start = time.perf_counter()
    probes = yield from _probe_light(store, scene, cube_map, parts)
    add_seconds(store, seconds, "error", time.perf_counter() - start)
    # What nothing can be in front of gathers nothing.
    spared = open_points(scene)
    skipped = {"gather_open_points": int(spared.sum())}
    bound = _most_bounced(scene.points.albedo, probes, spared)
    if bound <= settings.tolerance / 2:
        skipped["bounces_below"] = bound
        return 0, bound, 0, skipped
    rounds, error, pace = 0, np.inf, Pace(pace, 1 << 15, apart=caster.threads > 1)
    while rounds < MOST_ROUNDS and error > settings.tolerance:
        rounds += 2
        yield Progress("gather", 0, n_points)
        for index, block in enumerate(parts):
            for turn in (rounds - 2, rounds - 1):
                done = store.has_chunk("gather", index, turn)
                if not (done and store.has_chunk("gather_rays", turn, index, 0)):
                    start, tally = time.perf_counter(), []
                    found, back = yield from gather_steps(
                        scene, caster, block, settings.seed, turn, tally.append, pace, spared
                    )
                    counts[turn, index] = np.concatenate([[sum(tally)], back])
                    hits[block, turn * ROUND : (turn + 1) * ROUND] = found
                    add_seconds(store, seconds, "gather", time.perf_counter() - start)
            yield Progress("gather", block.stop, n_points)
        start = time.perf_counter()
        error = yield from beside("bounces", _bounce_error, hits, scene, rounds, probes, settings)
        add_seconds(store, seconds, "error", time.perf_counter() - start)
    store.update(rounds=rounds)
    skipped["gather_rays"] = skipped["gather_open_points"] * rounds * ROUND
    return int(counts[:rounds, :, 0].sum()), float(error), rounds, skipped


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
    directions = cube_map.directions
    towards = np.array([[0.8, 0.3, 0.52], [-0.5, -0.7, 0.51]])
    light = np.ones((cube_map.n_directions, 3), np.float32)
    light[:, 1:] = np.exp(12 * (directions @ towards.T - 1))
    bits = store.array("visibility")
    received = []
    for block in parts:
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
    for block in blocks(n_points):
        chunk = hits[block, : (rounds[-1] + 1) * ROUND].reshape(block.stop - block.start, -1, ROUND)
        chunk = chunk[:, rounds].reshape(len(chunk), -1)
        expect(
            chunk.min() >= -1 and chunk.max() < n_points,
            "gather: a hit names a point that does not exist; the bake is damaged",
        )
        parts.append(gather_operator(chunk, n_points))
    return sp.vstack(parts, format="csr") if len(parts) > 1 else parts[0]
