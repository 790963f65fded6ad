"""Rays for the set bits of masks: packed bits in, packed bits out."""

import numpy as np

from prt_core.errors import expect_kind
from prt_core.rays import shared
from prt_core.runtime.cores import n_cores
from prt_core.runtime.progress import Pace, Progress
from prt_core.runtime.threads import on_all_cores
from prt_core.scene import Scene
from prt_core.sphere import CubeMap

# Rays prepared at once, at most (but for one point's).
_RAYS = 1 << 21
# Rows prepared by a thread, at least.
_ROWS = 64
_COUNT = np.array([value.bit_count() for value in range(1 << 16)], np.uint8)


def count_bits(bits, axis=None):
    """Number of set bits of a uint8 array, int64: of all, or along its last axis."""
    if bits.ndim and bits.shape[-1] % 2 == 0 and bits.flags.c_contiguous:
        bits = bits.view(np.uint16)
    return _COUNT[bits].sum(axis=axis, dtype=np.int64)


class Tracer:
    """Casts the rays of entries that masks name, and counts them.

    Parameters
    ----------
    scene : Scene
    cube_map : CubeMap
    caster : RayCaster
    tally : callable(int), optional
    pace : Pace, optional
        In rays.
    stage : str
        Of the `Progress` it yields.

    Attributes
    ----------
    rays : int
    done : int
        Points that are known, for `Progress`; whoever traces sets it.
    """

    def __init__(self, scene, cube_map, caster, tally=None, pace=None, stage="visibility"):
        expect_kind("scene", scene, Scene)
        expect_kind("cube_map", cube_map, CubeMap)
        self._origins = scene.ray_origins
        self._directions = cube_map.samples.astype(np.float32)
        self._caster, self._tally = shared(caster), tally
        self._pace = pace or Pace()
        self.n_points = len(self._origins)
        self.rays = self.done = 0
        self._stage = stage

    def progress(self):
        """How far the sampling is."""
        return Progress(self._stage, min(self.done, self.n_points), self.n_points)

    def trace(self, points, mask):
        """Trace the entries of a mask; a generator of `Progress`.

        Parameters
        ----------
        points : (n,) int
        mask : (n, n_bytes) uint8

        Returns
        -------
        (n, n_bytes) uint8
            Set where the mask is and nothing is in the way.
        """
        free = np.zeros_like(mask)
        yield from self.trace_into(points, np.arange(len(points)), mask, free)
        return free

    def trace_into(self, points, rows, mask, bits, traced=None):
        """Trace the entries of a mask and put the answers where they belong, in place.

        Parameters
        ----------
        points : (n,) int
        rows : (m,) int
            Of `points`, `bits` and `traced`.
        mask : (m, n_bytes) uint8
        bits : (n, n_bytes) uint8
            Entries of the mask become 1 where nothing is in the way, else 0.
        traced : (n, n_bytes) uint8, optional
            Entries of the mask become 1.
        """
        # Eight rays a byte at most: to count the bits would take longer.
        ends = 8 * np.cumsum(np.count_nonzero(mask, axis=1))
        first = 0
        while first < len(rows):
            before = ends[first - 1] if first else 0
            stop = max(first + 1, int(np.searchsorted(ends, before + _RAYS, "right")))
            part = slice(first, stop)
            yield from self._trace_some(points, rows[part], mask[part], bits, traced)
            first = stop

    def _trace_some(self, points, rows, mask, bits, traced):
        size = max(_ROWS, -(-len(rows) // (4 * n_cores())))
        parts = [slice(first, first + size) for first in range(0, len(rows), size)]

        def prepare(part):
            row, direction, *kept = _entries(mask[part])
            point = points[rows[part][row]]
            return self._origins.take(point, axis=0), self._directions.take(direction, axis=0), kept

        def finish(part, free, kept):
            (byte_row, byte), chosen, spread, entry = kept
            spread.reshape(-1)[entry] = free
            free = np.packbits(spread, axis=1, bitorder="little")[:, 0]
            place = rows[part][byte_row] * np.int64(mask.shape[1]) + byte
            flat = bits.reshape(-1)
            flat[place] = flat[place] & ~chosen | free
            if traced is not None:
                flat = traced.reshape(-1)
                flat[place] |= chosen

        prepared = on_all_cores(prepare, parts)
        origins, directions, kept = zip(*prepared, strict=True)
        ends = np.cumsum([len(batch) for batch in origins])
        free = yield from self._cast(np.concatenate(origins), np.concatenate(directions))
        jobs = zip(parts, np.split(free, ends[:-1]), kept, strict=True)
        on_all_cores(lambda job: finish(*job), jobs)

    def trace_pairs(self, point, direction):
        """Trace single entries, each once however often it is named; yields `Progress`.

        Parameters
        ----------
        point, direction : (m,) int

        Returns
        -------
        (m,) bool
            Whether nothing is in the way.
        """
        pairs = point.astype(np.int64) * len(self._directions) + direction
        pairs, place = np.unique(pairs, return_inverse=True)
        point, direction = np.divmod(pairs, len(self._directions))
        free = yield from self._cast(
            self._origins.take(point, axis=0), self._directions.take(direction, axis=0)
        )
        return free[place]

    def _cast(self, origins, directions):
        n_rays = len(origins)
        free = np.empty(n_rays, bool)
        for start in range(0, n_rays, self._caster.batch):
            stop = min(start + self._caster.batch, n_rays)
            for part in self._pace.parts(start, stop):
                free[part] = ~self._caster.occluded(origins[part], directions[part])
                self._pace.worked()
                yield self.progress()
        self.rays += n_rays
        if self._tally is not None and n_rays:
            self._tally(n_rays)
        return free


def _entries(mask):
    """Row and direction of every set bit; the bytes that hold them, spread into bits."""
    flat = mask.reshape(-1)
    used = np.flatnonzero(flat != 0)
    chosen = flat[used]
    spread = np.unpackbits(chosen[:, None], axis=1, bitorder="little")
    entry = np.flatnonzero(spread.view(bool))
    row, byte = np.divmod(used.astype(np.int32), np.int32(mask.shape[1]))
    slot = entry >> 3
    direction = byte[slot] * np.int32(8) + (entry & 7).astype(np.int32)
    return row[slot], direction, (row, byte), chosen, spread, entry
