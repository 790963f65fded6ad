"""Visibility that is sampled in tiles: each alone, in any order, by whoever comes by.

A tile holds neighbouring points (see `sampling.tiles`); what is in memory at once is one of them.
Once all are there the certificate draws from all of them together, object by object, as from points
that were sampled in one piece; only where it fails are tiles asked again, and only those that hold
such points. In the end rows go to where the points are.
"""

import time

import numpy as np

from prt_core.bake import visibility
from prt_core.bake.sampled import (
    asked_again_steps,
    certified_steps,
    sample_arrays,
    sampled_attributes,
    sampler_settings,
    small_groups,
)
from prt_core.bake.stages import WORK, BlocksMissing, open_stage
from prt_core.bake.tile_rows import COUNTS, TileArrays, TileRows
from prt_core.bake.visibility import STAGE
from prt_core.runtime.machine import return_memory
from prt_core.runtime.progress import Pace, Progress
from prt_core.sampling import (
    Sampled,
    certified_together,
    sample_agreement,
    tile_scene,
    tiles_of,
    trace_rest,
)
from prt_core.sampling.tracer import count_bits
from prt_core.store import damage_as_error

# The sampler that is good for tiles: others look at all of a scene, to choose where they look.
METHOD = "agreement"
# The attribute that says how many points a tile has, at most; and the part of the attribute "work"
# that says which groups and tiles each turn asks again.
TILE, ASKED = "tile", "asked"


class TileBlocks:
    """The tiles of a bake under way.

    Parameters
    ----------
    arrays : TileArrays
    tiles : list of (n,) int64
        The points of each.
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : BakeSettings
    groups : Groups
        What is certified together.
    reuse : Reuse, optional
        What it knows is not asked.
    """

    def __init__(self, arrays, tiles, scene, cube_map, caster, settings, groups, reuse=None):
        self.arrays, self.tiles, self.groups = arrays, tiles, groups
        self._scene, self._cube_map, self._caster = scene, cube_map, caster
        self._settings, self._reuse = settings, reuse
        self._small = small_groups(groups.index, cube_map)
        if reuse is not None:
            self._small &= ~reuse.still

    @classmethod
    def begun(cls, store, scene, cube_map, caster, settings, reuse=None):
        """Those of a bake whose arrays are made, or taken as far as they are there."""
        tiles = tiles_of(scene, store.attributes[TILE])
        n_rows = max(map(len, tiles))
        arrays = TileArrays.begun(store, 0, len(tiles), n_rows, -(-cube_map.n_directions // 8))
        groups = certified_together(scene)
        return cls(arrays, tiles, scene, cube_map, caster, settings, groups, reuse)

    @classmethod
    def opened(cls, store, scene, cube_map, caster, settings):
        """Those of a bake that another process has begun."""
        tiles, arrays = tiles_of(scene, store.attributes[TILE]), TileArrays.opened(store, 0)
        groups = certified_together(scene)
        return cls(arrays, tiles, scene, cube_map, caster, settings, groups)

    def is_done(self, index):
        """Whether a tile is there."""
        return self.arrays.holds(index)

    def again(self, store, turn):
        """Those of a turn that another process has begun: `compute_steps`."""
        return _Again(self, store, turn)

    def bits_of(self, index):
        """(n, n_bytes) uint8 of the points of a tile that is there."""
        return self.arrays["bits"][index, : len(self.tiles[index])]

    def compute_steps(self, index, pace=None):
        """Sample a tile, and yield `Progress`; returns how many rays it took."""
        points = self.tiles[index]
        given = tile_scene(self._scene, points), self._cube_map, self._caster
        wanted = sampler_settings(self._settings, METHOD, self._reuse)
        known = None if self._reuse is None else self._reuse.known(self._cube_map, points)
        sampled = yield from sample_agreement(*given, wanted, pace=pace, known=known)
        small = self._small[points]
        if small.any():
            sampled = yield from trace_rest(*given, sampled, small, pace=pace)
        self.arrays.write(index, sampled)
        return sampled.rays

    def asked_again(self, index, before, again, turn, pace):
        """Steps that ask points of a tile again, `again` (n,) bool, from what was known before."""
        given = tile_scene(self._scene, self.tiles[index]), self._cube_map, self._caster
        return asked_again_steps(*given, self._settings, before, again, turn, pace)


class _Again:
    """Tiles that are asked again in a turn, by somebody who has not certified them."""

    def __init__(self, work, store, turn):
        self._work, self._turn = work, turn
        self._arrays = [TileArrays.opened(store, number) for number in range(turn + 1)]
        with damage_as_error(store.path):
            self._asked = [store.attributes[WORK][ASKED][n] for n in range(turn)]
        self._own = [store.read(_own(kind, turn)) for kind in ("points", "bits", "traced")]

    def compute_steps(self, index, pace=None):
        """Ask a tile again, and yield `Progress`; returns how many rays it took."""
        work, tile = self._work, self._work.tiles[index]
        # As the last turn left it that asked it, but for rows that the certificate found out since.
        last = max(
            [n + 1 for n, each in enumerate(self._asked[:-1]) if index in each["tiles"]] + [0]
        )
        rows = [self._arrays[last][kind][index, : len(tile)] for kind in ("bits", "traced")]
        points, *own = self._own
        inside = np.isin(points, tile)
        place = np.searchsorted(tile, points[inside])
        for values, known in zip(rows, own, strict=True):
            values[place] = known[inside]
        again = np.isin(work.groups.index[tile], self._asked[-1]["groups"])
        steps = work.asked_again(index, Sampled(*rows, 0), again, self._turn - 1, pace)
        sampled = yield from steps
        self._arrays[-1].write(index, sampled)
        return sampled.rays


def tiled_steps(
    store, scene, cube_map, caster, settings, lights, pace, pictures, here, memory, reuse=None
):  # fmt: skip
    """Sample tiles, certify them together, and store; yields `Progress`.

    Parameters
    ----------
    store : BakeStore
        Its attribute "tile" says how large tiles are.
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    settings : BakeSettings
    lights, pace, pictures
        See `bake_steps`.
    here : bool
        Whether tiles that are missing are sampled; otherwise they are said.
    memory : Memory
    reuse : Reuse, optional
        What it knows is not asked.

    Returns
    -------
    attributes : dict
        For the report (see `visibility_steps`).
    spent : dict of str -> float
        Seconds by stage.
    """
    start, rays = time.perf_counter(), Pace(pace, 1 << 15)
    work = TileBlocks.begun(store, scene, cube_map, caster, settings, reuse)
    tiles, n_points = work.tiles, len(scene.points)
    missing = [index for index in range(len(tiles)) if not work.is_done(index)]
    if missing and not here:
        open_stage(store, STAGE, len(tiles))
        raise BlocksMissing(store.path, STAGE, missing)
    done = n_points - sum(len(tiles[index]) for index in missing)
    for index in missing:
        yield from _within(work.compute_steps(index, rays), done, n_points)
        done += len(tiles[index])
        if pictures is not None:
            pictures.block(tiles[index], work.bits_of(index))
        yield Progress("visibility", done, n_points)
    return_memory()
    sampled = _joined(work, memory)
    spent = {"visibility": time.perf_counter() - start, "certificate": 0.0}

    def ask_again(sampled, points, turn):
        arrays = TileArrays.begun(store, turn + 1, len(tiles), max(map(len, tiles)), row_bytes)
        asked = [index for index, tile in enumerate(tiles) if points[tile].any()]
        missing = [index for index in asked if not arrays.holds(index)]
        if missing and not here:
            groups = np.unique(work.groups.index[points]).tolist()
            _open_turn(store, sampled, turn + 1, {"groups": groups, "tiles": asked}, len(tiles))
            raise BlocksMissing(store.path, f"{STAGE}{turn + 1}", missing)
        for index in missing:
            tile = tiles[index]
            before = Sampled(sampled.bits[tile], sampled.traced[tile], 0)
            steps = work.asked_again(index, before, points[tile], turn, rays)
            arrays.write(index, (yield from _within(steps, n_points, n_points)))
        for index in asked:
            for rows in (sampled.bits, sampled.traced):
                rows.replace(index, tiles[index], arrays)
        _add_counts(sampled, arrays.counts(asked))
        return sampled

    row_bytes = sampled.bits.shape[1]
    sampled, errors, turns = yield from certified_steps(
        scene, cube_map, caster, sampled, lights, settings, work.groups, ask_again, spent, rays,
        reuse,
    )  # fmt: skip
    start, traced = time.perf_counter(), 0
    arrays = sample_arrays(store, sampled.bits.shape)
    block = visibility.BLOCK
    span = max(1, memory.span(row_bytes) // block) * block
    for first in range(0, n_points, span):
        part = slice(first, min(first + span, n_points))
        for array, rows in zip(arrays, (sampled.bits, sampled.traced), strict=True):
            values = rows[part]
            array[part] = values
        traced += int(count_bits(values))
        yield Progress("store", part.stop, n_points)
    spent["store"] = time.perf_counter() - start
    above = sampled.attributes["hemisphere_entries"]
    attributes = sampled_attributes(
        scene, cube_map, METHOD, sampled, errors, turns, settings, traced, above
    )
    return attributes, spent


def _open_turn(store, sampled, turn, asked, n_tiles):
    """Let tiles be asked again by others: which, and what was found out of them so far."""
    store.write(_own("points", turn), sampled.bits.own[0])
    for kind in ("bits", "traced"):
        store.write(_own(kind, turn), getattr(sampled, kind).own[1])
    before = store.attributes.get(WORK, {}).get(ASKED, [])[: turn - 1]
    open_stage(store, f"{STAGE}{turn}", n_tiles, **{ASKED: [*before, asked]})


def _own(kind, turn):
    return f"tile_own_{kind}{turn}"


def _within(steps, done, n_points):
    """Steps of a tile, as steps of all of them."""
    while True:
        try:
            progress = next(steps)
        except StopIteration as end:
            return end.value
        yield Progress(progress.stage, min(done + progress.done, n_points), n_points)


def _joined(work, memory):
    """All tiles as one `Sampled`, read where it is indexed."""
    rows = [TileRows(kind, work.tiles, work.arrays, memory.kept) for kind in ("bits", "traced")]
    counts = work.arrays.counts(range(len(work.tiles)))
    totals, levels = counts.sum(axis=0), counts[:, len(COUNTS) :]
    levels = levels.sum(axis=0)[levels.any(axis=0)].tolist()
    attributes = dict(zip(COUNTS, map(int, totals), strict=False))
    sampled = Sampled(*rows, attributes.pop("rays"), {}, {"levels": levels, **attributes})
    if len(work.tiles) > 1:
        sampled.attributes["tiles"] = len(work.tiles)
    return sampled


def _add_counts(sampled, counts):
    """What asking again took is added to what sampling did."""
    for name, count in zip(COUNTS, np.sum(counts, axis=0), strict=False):
        if name == "rays":
            sampled.rays += int(count)
        elif name in ("given_up", "first", "disagree", "check", "follow", "rest"):
            sampled.attributes[name] += int(count)
