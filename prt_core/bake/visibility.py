"""Visibility as it is stored, in blocks of points; and the stage that traces every entry of it."""

import time

import numpy as np

from prt_core.bake.stages import BlocksMissing, open_stage
from prt_core.errors import expect_one_of
from prt_core.runtime.files import file_without_name
from prt_core.runtime.progress import Pace, Progress
from prt_core.sampling import sampler_names
from prt_core.sampling.tracer import Tracer
from prt_core.transport import visibility_bits

BLOCK = 2048
# The stage, its array of bits, and how many rays each block of it took.
STAGE, RAYS = "visibility", "visibility_rays"
# The points that a sampler traced densely, where it is one that does.
DENSE = "dense"
# Below so many rays every entry is traced: it takes a second at most, and there is no error.
_FEW_RAYS = 1 << 21


def expect_method(method):
    """Raise `PRTError` unless `method` names a way to sample."""
    expect_one_of("method", method, ("auto", "exhaustive", *sampler_names()))


def chosen_method(method, n_points, n_directions):
    """What `auto` stands for: every entry where there are few, else sampling by agreement."""
    if method != "auto":
        return method
    return "exhaustive" if n_points * n_directions // 2 < _FEW_RAYS else "agreement"


def blocks(n_points):
    """Slices of the points that are stored together."""
    return [slice(f, min(f + BLOCK, n_points)) for f in range(0, n_points, BLOCK)]


def add_seconds(seconds, stage, spent):
    """Add to the time of a stage; attributes are written at its end, not after every block."""
    seconds[stage] = seconds.get(stage, 0.0) + spent


class ExhaustiveBlocks:
    """Blocks of points of which every entry is traced.

    Parameters
    ----------
    bits, counts : BakeArray
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    reuse : Reuse, optional
        What it knows is not traced.
    """

    def __init__(self, bits, counts, scene, cube_map, caster, reuse=None):
        self.bits, self.counts, self.parts = bits, counts, blocks(len(scene.points))
        self._scene, self._cube_map, self._caster = scene, cube_map, caster
        self._reuse = reuse

    @classmethod
    def begun(cls, store, scene, cube_map, caster, reuse=None):
        """Those of a bake whose arrays are made, or taken as far as they are there."""
        n_points, n_bytes = len(scene.points), -(-cube_map.n_directions // 8)
        bits = store.create(STAGE, (n_points, n_bytes), "uint8", (BLOCK, n_bytes))
        counts = store.create(RAYS, (len(blocks(n_points)),), "int64", (1,))
        return cls(bits, counts, scene, cube_map, caster, reuse)

    @classmethod
    def opened(cls, store, scene, cube_map, caster):
        """Those of a bake that another process has begun."""
        return cls(store.array(STAGE), store.array(RAYS), scene, cube_map, caster)

    def is_done(self, index):
        """Whether a block is there."""
        return self.bits.holds(self.parts[index]) and self.counts.holds(index)

    def compute_steps(self, index, pace=None):
        """Trace a block, and yield `Progress`; returns how many rays it took."""
        block, tally = self.parts[index], []
        traced = np.empty((block.stop - block.start, self.bits.shape[1]), np.uint8)
        pace = pace or Pace()
        for part in pace.parts(block.start, block.stop):
            inside = slice(part.start - block.start, part.stop - block.start)
            if self._reuse is None:
                given = self._scene, self._cube_map, self._caster
                traced[inside] = visibility_bits(*given, part, tally.append)
            else:
                traced[inside] = yield from self._rest_steps(part, tally.append)
            pace.worked()
            yield Progress("visibility", part.stop, self.bits.shape[0])
        self.counts[index] = sum(tally)
        self.bits[block] = traced
        return sum(tally)

    def _rest_steps(self, part, tally):
        """Bits of some points of which much is known; yields `Progress`."""
        points = np.arange(part.start, part.stop)
        known = self._reuse.known(self._cube_map, points)
        tracer = Tracer(self._scene, self._cube_map, self._caster, tally)
        free = yield from tracer.trace(points, known.above & ~known.known)
        return known.bits & known.known | free


def exhaustive_steps(
    store, scene, cube_map, caster, seconds, pace, pictures=None, here=True, reuse=None
):  # fmt: skip
    """Every entry of a scene into a store; yields `Progress`, returns how many rays it took."""
    n_points = len(scene.points)
    work = ExhaustiveBlocks.begun(store, scene, cube_map, caster, reuse)
    yield Progress("visibility", 0, n_points)
    pace = Pace(pace)
    for index, block in enumerate(work.parts):
        if not work.is_done(index):
            if not here:
                open_stage(store, STAGE, len(work.parts))
                rest = range(index, len(work.parts))
                raise BlocksMissing(store.path, STAGE, [i for i in rest if not work.is_done(i)])
            start = time.perf_counter()
            yield from work.compute_steps(index, pace)
            add_seconds(seconds, "visibility", time.perf_counter() - start)
            if pictures is not None:
                pictures.block(block, work.bits[block])
        yield Progress("visibility", block.stop, n_points)
    return int(work.counts[...].sum())


def read_visibility(store, shape, memory):
    """The bits of a bake, (n_points, n_bytes) uint8: in memory, or a map of a file without a name.

    Parameters
    ----------
    store : BakeStore
    shape : (int, int)
    memory : Memory
        Which may hold them or not.

    Raises
    ------
    PRTError
        They are missing, damaged, or of another shape.
    """
    if memory.holds(shape[0] * shape[1]):
        return store.read(STAGE, shape, "uint8")
    array = store.array(STAGE)
    store.expect_shape(array, shape, "uint8")
    array.expect_whole()
    with file_without_name(store.path.parent) as file:
        bits = np.memmap(file, np.uint8, "r+", shape=shape)
    for block in blocks(shape[0]):
        bits[block] = array[block]
    store.expect_sealed(array)
    bits.flush()
    return bits
