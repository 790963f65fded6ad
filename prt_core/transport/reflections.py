"""What reflections see: for each block of directions in which something is in the way, where.

Visibility says that a direction is blocked, not by what. So from each glossy point one ray goes
into every block that is blocked at least in part, through one of its blocked texels, and what it
meets is handed to a bake point as bounce rays are (see `transport.sharing`). That point's radiance
stands for all that is in the way in the block.

Small blocks lie so close together that every other one is enough, as on a chequerboard: those
between take what one of their neighbours has met, but where that is curved metal, which mirrors
something else in each block.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind
from prt_core.rays import Hits
from prt_core.runtime.seeds import Stage, generator
from prt_core.sphere import Blocks
from prt_core.transport.sharing import DARK, MISS
from prt_core.transport.visibility import expect_bits, horizon_bits

# Shares are stored in steps of this.
_STEP = 255
# Every other block is enough where a face has more of them along an edge.
_WHOLE = 8
# Cosine between normals of metal above which neighbours mirror about the same.
_EVEN = 0.999


@dataclass(frozen=True)
class Reflections:
    """What glossy points see of the scene, a row of entries for each point.

    Attributes
    ----------
    points : (n,) int32
        The glossy bake points, ascending.
    blocks : Blocks
    start : (n + 1,) int64
        Where the entries of each begin.
    block : (m,) uint16
        In which something is in the way, ascending in each row.
    met : (m,) int32
        The bake point that stands for it; DARK where that returns no light.
    share : (m,) uint8
        How much of the block it hides above the horizon, in 255ths of its solid angle.
    """

    points: np.ndarray
    blocks: Blocks
    start: np.ndarray
    block: np.ndarray
    met: np.ndarray
    share: np.ndarray

    def __post_init__(self):
        expect_kind("blocks", self.blocks, Blocks)
        m = int(self.start[-1]) if len(self.start) else 0
        expect_array("points", self.points, (len(self.start) - 1,), np.int32, 0)
        expect_array("block", self.block, (m,), np.uint16, most=len(self.blocks) - 1)
        expect_array("met", self.met, (m,), np.int32, DARK)
        expect_array("share", self.share, (m,), np.uint8)

    @classmethod
    def of_tables(cls, points, blocks, tables):
        """From tables of `Seen`, part by part.

        Parameters
        ----------
        points : (n,) int
        blocks : Blocks
        tables : iterable of (met, share)
            (k, n_blocks) each, together n rows.
        """
        counts, block, met, share = [np.zeros(1, np.int64)], [], [], []
        for ends, shares in tables:
            row, column = np.nonzero(shares)
            counts.append(np.bincount(row, minlength=len(shares)))
            block.append(column.astype(np.uint16))
            met.append(ends[row, column])
            share.append(shares[row, column])
        parts = [np.concatenate(part) if part else [] for part in (block, met, share)]
        types = np.uint16, np.int32, np.uint8
        parts = [np.asarray(part, dtype) for part, dtype in zip(parts, types, strict=True)]
        start = np.cumsum(np.concatenate(counts))
        return cls(np.asarray(points, np.int32), blocks, start, *parts)

    def __len__(self):
        return len(self.points)

    def places(self, part, width=None):
        """Where entries of a slice of the points are in a table (len(part), width).

        Parameters
        ----------
        part : slice
        width : int, optional
            Default: the number of blocks.

        Returns
        -------
        places : (k,) int64
        entries : slice
        """
        entries = slice(int(self.start[part.start]), int(self.start[part.stop]))
        counts = np.diff(self.start[part.start : part.stop + 1])
        row = np.repeat(np.arange(len(counts)), counts)
        return row * (width or len(self.blocks)) + self.block[entries], entries

    @property
    def nbytes(self):
        """Of the arrays."""
        arrays = self.points, self.start, self.block, self.met, self.share
        return sum(array.nbytes for array in arrays)


@dataclass(frozen=True)
class Seen:
    """What some points see: as `Reflections` has it, and how it was found out.

    Attributes
    ----------
    met : (n, n_blocks) int32
    share : (n, n_blocks) uint8
    n_rays, n_short : int
        Cast from the points; and from what they met.
    n_lost : int
        Rays that met nothing, where visibility says that something is.
    """

    met: np.ndarray
    share: np.ndarray
    n_rays: int
    n_short: int
    n_lost: int


def reflection_hits(scene, caster, sharing, blocks, points, bits, seed, key=0, metal=None):
    """What some points see in the blocks in which something is in the way.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    sharing : Sharing
        Of the scene.
    blocks : Blocks
    points : (n,) int
    bits : (n, n_bytes) uint8
        Their visibility.
    seed, key : int
        Random numbers depend on these alone.
    metal : (n_points,) bool, optional
        Points that reflect as metals do: where these are curved each block is cast.

    Returns
    -------
    Seen
    """
    cube_map = blocks.cube_map
    expect_bits("bits", bits, cube_map.n_directions)
    points = np.asarray(points)
    expect(len(points) == len(bits), f"bits: expected {len(points)} rows, got {len(bits)}")
    blocked = horizon_bits(scene, cube_map, points) & ~bits
    patterns = blocks.patterns(blocked)
    share = np.minimum(blocks.pattern_shares(patterns), 1)
    share = np.rint(share * _STEP).astype(np.uint8)
    rng = generator(seed, Stage.REFLECTIONS, key)
    rays = _Rays(scene, caster, sharing, blocks, points, patterns, rng)
    if blocks.side <= _WHOLE:
        rays.cast(*np.nonzero(share))
    else:
        taken = _Neighbours(share, blocks.side, rng)
        rays.cast(*np.nonzero(taken.cast))
        if metal is not None:
            rays.cast(*taken.leave(rays.met, metal, scene.points.normals))
        taken.fill(rays.met)
    if rays.n_lost:
        _fill(rays.met, share)
    return Seen(rays.met, share, rays.n_rays, rays.n_short, rays.n_lost)


class _Rays:
    """Rays through blocked texels of blocks, and what they have met: (n, n_blocks) int32."""

    def __init__(self, scene, caster, sharing, blocks, points, patterns, rng):
        self._starts, self._caster, self._sharing = scene.ray_origins[points], caster, sharing
        self._blocks, self._patterns, self._rng = blocks, patterns, rng
        self.met = np.full(patterns.shape[:2], MISS, np.int32)
        self.n_rays = self.n_short = self.n_lost = 0

    def cast(self, row, block):
        """One ray for each block of a row."""
        blocks, rng = self._blocks, self._rng
        texel = blocks.texels[block, _one_of(self._patterns[row, block], blocks.n_texels, rng)]
        directions = blocks.cube_map.samples[texel].astype(np.float32)
        pick = rng.random(len(row), np.float32)
        ends, n_short = _ends(self._caster, self._sharing, self._starts[row], directions, pick)
        self.met[row, block] = ends
        self.n_rays += len(row)
        self.n_short += n_short
        self.n_lost += int(np.count_nonzero(ends == MISS))


class _Neighbours:
    """Which blocks take what one beside them has met.

    Parameters
    ----------
    share : (n, n_blocks) uint8
        Not 0 where something is in the way.
    side : int
        Blocks along an edge of a face.
    rng : numpy.random.Generator

    Attributes
    ----------
    cast : (n, n_blocks) bool
        The others of those in which something is in the way.
    """

    def __init__(self, share, side, rng):
        place = np.arange(share.shape[1])
        odd = (place + place // side) % 2 == 1
        # Which half it is differs from point to point, and which of the neighbours.
        half = odd ^ rng.integers(0, 2, (len(share), 1)).astype(bool)
        wanted = share > 0
        self.cast = wanted & half
        self._rows, self._blocks = np.nonzero(wanted & ~half)
        x, y = self._blocks % side, self._blocks // side % side
        sides = ((x > 0, -1), (y > 0, -side), (x < side - 1, 1), (y < side - 1, side))
        self._beside = np.full((4, len(self._rows)), -1, np.int32)
        for beside, (inside, step) in zip(self._beside, sides, strict=True):
            mine = np.flatnonzero(inside)
            there = self._blocks[mine] + step
            beside[mine] = np.where(self.cast[self._rows[mine], there], there, -1)
        first = rng.integers(0, 4, len(self._rows), np.uint8)
        self._from = np.full(len(self._rows), -1, np.int32)
        for turn in range(4):
            mine = np.flatnonzero(self._from < 0)
            self._from[mine] = self._beside[(first[mine] + turn) % 4, mine]
        alone = self._from < 0
        self.cast[self._rows[alone], self._blocks[alone]] = True
        self._keep(~alone)

    def _keep(self, some):
        self._rows, self._blocks, self._from = (
            values[some] for values in (self._rows, self._blocks, self._from)
        )
        self._beside = self._beside[:, some]

    def leave(self, met, metal, normals):
        """(rows, blocks) that take nothing after all: beside them is metal, and it is not even."""
        mine = np.flatnonzero(metal[met[self._rows, self._from]])
        mine = mine[met[self._rows[mine], self._from[mine]] >= 0]
        rows, own = self._rows[mine], normals[met[self._rows[mine], self._from[mine]]]
        uneven = np.zeros(len(mine), bool)
        for beside in self._beside[:, mine]:
            there = met[rows, beside]
            even = (there >= 0) & (np.einsum("mx,mx->m", own, normals[there]) > _EVEN)
            uneven |= (beside >= 0) & ~even
        left = mine[uneven]
        result = self._rows[left], self._blocks[left]
        self._keep(~np.isin(np.arange(len(self._rows)), left))
        return result

    def fill(self, met):
        """Give these blocks what the others have met, (n, n_blocks) int32."""
        met[self._rows, self._blocks] = met[self._rows, self._from]


def _one_of(patterns, n_texels, rng):
    """(m,) int: the place of one of the set bits of each pattern (m, n_bytes), at random."""
    bits = np.unpackbits(patterns, axis=1, count=n_texels, bitorder="little")
    ends = np.cumsum(bits, axis=1, dtype=np.uint16)
    wanted = (rng.random(len(bits), np.float32) * ends[:, -1]).astype(np.uint16)
    return (ends <= wanted[:, None]).sum(axis=1)


def _ends(caster, sharing, starts, directions, pick):
    """(m,) int32 bake points that rays end at, and how many short rays that took."""
    batches = [slice(first, first + caster.batch) for first in range(0, len(starts), caster.batch)]
    if not batches:
        return np.zeros(0, np.int32), 0
    hits = Hits.joined([caster.intersect(starts[part], directions[part]) for part in batches])
    ends, _, _, short = sharing.ends(caster, hits, directions, pick)
    return ends, int(short.sum(dtype=np.int64))


def _fill(met, share):
    """Where visibility was reconstructed and the ray met nothing: what the block before it met."""
    wanted = share > 0
    good = wanted & (met != MISS)
    place = np.where(good, np.arange(met.shape[1]), -1)
    before = np.maximum.accumulate(place, axis=1)
    # Those before the first one that is known take that.
    first = np.argmax(good, axis=1)[:, None]
    before = np.where(before < 0, first, before)
    filled = np.take_along_axis(met, before, axis=1)
    filled[~good.any(axis=1)] = DARK
    met[wanted] = filled[wanted]
