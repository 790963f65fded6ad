"""Blocks of work: a planned bake computed by anybody, anywhere, in any order.

A block is (store, stage, index). To compute it needs the store and nothing else: the scene is in
there, Blender is not asked. It may be done again, by two at once, and be killed: what is written is
the same bit for bit, each file whole or not there. Nobody but who plans and finishes the bake (see
`bake.plan`) writes what is said of it. So a farm is a loop:

    plan the bake
    while finishing it raises `BlocksMissing`:
        for each of its blocks, anywhere: compute(path, stage, index)
"""

import json
import threading
import time
from dataclasses import dataclass

from prt_core.bake.gather_blocks import GATHER, GATHER_RAYS, GatherBlocks, holds_rays
from prt_core.bake.settings import BakeSettings
from prt_core.bake.stages import (
    OPEN,
    WORK,
    Stage,
    is_planned,
    note_figures,
    open_stages,
    read_figures,
)
from prt_core.bake.tile_rows import TileArrays
from prt_core.bake.tiled import ASKED, TILE, TileBlocks
from prt_core.bake.visibility import RAYS as VISIBILITY_RAYS
from prt_core.bake.visibility import STAGE as VISIBILITY
from prt_core.bake.visibility import ExhaustiveBlocks, blocks
from prt_core.errors import expect, expect_one_of, expect_whole, system_errors
from prt_core.runtime.address import expect_store_path
from prt_core.runtime.machine import return_memory
from prt_core.runtime.progress import run
from prt_core.sphere import CubeMap
from prt_core.store import BakeStore, damage_as_error, read_scene
from prt_core.store.attributes import read_attributes

# What the last call of this process opened, for the next one.
_lock = threading.Lock()
_stores, _kept = {}, {}


@dataclass(frozen=True)
class BlockDone:
    """What computing a block took.

    Attributes
    ----------
    stage : str
    index : int
    seconds : float
        Of the one that computed it, the wall clock's.
    rays : int
    again : bool
        Whether it was there already, and nothing was done.
    """

    stage: str
    index: int
    seconds: float
    rays: int
    again: bool = False


def stages(store):
    """The stages of a planned bake that are known by now.

    Where sampling was not near enough, and how many rounds of bounce rays are needed, shows while
    the bake is finished, step by step: each call of `finish_steps` may open another stage.

    Parameters
    ----------
    store : str, Path or BakeStore
        `NAME.prt`, planned (see `plan_steps`) and not finished.

    Returns
    -------
    list of Stage
        In the order in which they are needed; blocks of the same stage need nothing of each other.

    Raises
    ------
    PRTError
        There is no such bake, or it is not planned.
    """
    return open_stages(_planned(store))


def missing_blocks(store, stage):
    """Indices of the blocks of a stage that are not there, or are damaged.

    Parameters
    ----------
    store : str, Path or BakeStore
    stage : str or Stage

    Returns
    -------
    list of int
        Ascending.
    """
    store = _planned(store)
    known = _stage_of(store, stage)
    is_done = _holds(store, known)
    return [index for index in range(known.blocks) if not is_done(index)]


def compute(store, stage, index):
    """Compute one block of a planned bake; where it is there already nothing is done.

    The scene, and what casts its rays, are kept for the next call of this process.

    Parameters
    ----------
    store : str, Path or BakeStore
        `NAME.prt`.
    stage : str or Stage
        Of `stages`.
    index : int

    Returns
    -------
    BlockDone

    Raises
    ------
    PRTError
        There is no such bake, stage or block; the bake is finished or was not planned; what casts
        the rays is not installed; or what was computed is not there afterwards.
    """
    store = _planned(store)
    known = _stage_of(store, stage)
    index = expect_whole(f"block of stage '{known.name}'", index, 0, known.blocks - 1)
    with system_errors(store.path):
        is_done = _holds(store, known)
        if is_done(index):
            seconds, rays, _ = read_figures(store, known.name, range(index, index + 1))[0]
            return BlockDone(known.name, index, float(seconds), int(rays), True)
        done = _workplace(store).compute(store, known, index)
        # Who computes what is missing until nothing is would go on for ever.
        expect(
            is_done(index) or _is_over(store, known),
            f"{store.path}: block {index} of stage '{known.name}' was computed and is not there; "
            "another program has replaced or removed the bake, or its place keeps nothing",
        )
        return done


def block_figures(store, stage):
    """What the blocks of a stage took, as far as they are there.

    Parameters
    ----------
    store : str, Path or BakeStore
    stage : str or Stage

    Returns
    -------
    (n_blocks, 3) float64
        Seconds, rays, and rays that met too many surfaces that let light pass; 0 for blocks that
        were not computed.
    """
    store = _planned(store)
    known = _stage_of(store, stage)
    return read_figures(store, known.name, range(known.blocks))


def _planned(store):
    if not isinstance(store, BakeStore):
        store = _opened(expect_store_path("store", store))
    expect(
        not store.is_complete,
        f"{store.path}: the bake is finished; nothing of it is left to compute",
    )
    expect(
        is_planned(store),
        f"{store.path}: was not planned for blocks of work; begin with 'prt bake SCENE.blend "
        f"--plan -o {store.path}'",
    )
    return store


def _opened(path):
    """The store at a path, to read: who may write also removes what a kill left, another's too."""
    with _lock:
        store = _stores.get(path)
        # To open one looks at every file; while nothing is said anew that was done for the last.
        if store is None or read_attributes(store.files) != store.attributes:
            _stores.clear()
            store = _stores[path] = BakeStore(path)
        return store


def _stage_of(store, stage):
    known = {each.name: each for each in open_stages(store)}
    name = stage.name if isinstance(stage, Stage) else stage
    return known[expect_one_of("stage", name, tuple(known))]


def _holds(store, stage):
    """A function that tells whether a block of a stage is there."""
    if stage.name.startswith(GATHER):
        arrays, turns = (store.array(GATHER), store.array(GATHER_RAYS)), _rounds_of(store, stage)
        return lambda index: holds_rays(*arrays, index, turns)
    if stage.name != VISIBILITY:
        turn = _turn_of(stage)
        arrays = TileArrays.opened(store, turn)
        with damage_as_error(store.path, "its plan"):
            asked = set(store.attributes[WORK][ASKED][turn - 1]["tiles"])
        return lambda index: index not in asked or arrays.holds(index)
    if TILE in store.attributes:
        return TileArrays.opened(store, 0).holds
    bits, counts = store.array(VISIBILITY), store.array(VISIBILITY_RAYS)
    parts = blocks(len(bits))
    return lambda index: bits.holds(parts[index]) and counts.holds(index)


def _is_over(store, stage):
    """Whether the bake has gone on from a stage meanwhile: what was made of it is put together."""
    now = read_attributes(store.files) or {}
    sampled = stage.name.startswith(VISIBILITY) and now.get("sampled") is not None
    return sampled or now.get("complete") is True


def _workplace(store):
    """The `_Workplace` of a store; the last one of this process is kept."""
    attributes = store.attributes
    with damage_as_error(store.path, "its plan"):
        # What grows while the bake goes on is read where it is needed.
        plan = {k: v for k, v in attributes[WORK].items() if k not in ("stages", ASKED)}
    same = [*(attributes.get(name) for name in ("identity", "details", TILE)), plan]
    key = str(store.path.absolute()), json.dumps(same, sort_keys=True)
    with _lock:
        place = _kept.get(key)
        if place is None:
            # Threads that compute for the one before go on with it; the next block is elsewhere.
            _kept.clear()
            place = _kept[key] = _Workplace(store)
        return place


class _Workplace:
    """All that blocks of a store need, whatever the stage."""

    def __init__(self, store):
        attributes = store.attributes
        with damage_as_error(store.path):
            self._settings = BakeSettings(**attributes["settings"])
            work = dict(attributes[WORK])
            name = work["caster"]
        self._scene, self._cube_map = read_scene(store), CubeMap(self._settings.resolution)
        n_points = len(self._scene.points)
        # Found once, for the proof looks at all points together.
        self._scene.open_points = store.read(OPEN, (n_points,), "bool")
        self._caster = self._scene.make_caster(name, "diffuse", self._settings.resolution)
        self._blocks, self._lock = {}, threading.Lock()
        return_memory()

    def compute(self, store, stage, index):
        """Compute a block: `BlockDone`."""
        with self._lock:
            work = self._blocks_of(store, stage)
        start, before = time.perf_counter(), getattr(self._caster, "too_deep", 0)
        rays = work.compute(index)
        seconds = time.perf_counter() - start
        too_deep = getattr(self._caster, "too_deep", 0) - before
        note_figures(store, stage.name, index, (seconds, rays, too_deep))
        return BlockDone(stage.name, index, seconds, int(rays))

    def _blocks_of(self, store, stage):
        """What computes blocks of a stage: `compute(index)`."""
        if stage.name not in self._blocks:
            given = store, self._scene, self._cube_map, self._caster
            if stage.name.startswith(GATHER):
                gather = GatherBlocks.opened(*given, self._settings.seed)
                turns = _rounds_of(store, stage)
                self._blocks[stage.name] = _Rounds(gather, turns)
            elif TILE in store.attributes:
                tiles = TileBlocks.opened(*given, self._settings)
                if stage.name != VISIBILITY:
                    tiles = tiles.again(store, _turn_of(stage))
                self._blocks[stage.name] = _Steps(tiles)
            else:
                self._blocks[stage.name] = _Steps(ExhaustiveBlocks.opened(*given))
        return self._blocks[stage.name]


class _Steps:
    """Blocks that are computed by a generator."""

    def __init__(self, work):
        self._work = work

    def compute(self, index):
        """Compute a block; returns how many rays it took."""
        return run(self._work.compute_steps(index))


class _Rounds:
    """Blocks of points whose rays of some rounds are cast."""

    def __init__(self, gather, turns):
        self._gather, self._turns = gather, turns

    def compute(self, index):
        """Cast the rays of a block that are missing; returns how many these were."""
        turns = [turn for turn in self._turns if not self._gather.is_done(index, turn)]
        return self._gather.compute([(index, turn) for turn in turns])


def _turn_of(stage):
    """Which turn of asking again a stage is: 1 is the first."""
    return int(stage.name.removeprefix(VISIBILITY))


def _rounds_of(store, stage):
    """The rounds of rays of a stage: from those of the stage before it."""
    names = [each.name for each in open_stages(store) if each.name.startswith(GATHER)]
    stops = [0, *(int(name.removeprefix(GATHER)) for name in names)]
    place = names.index(stage.name)
    return range(stops[place], stops[place + 1])
