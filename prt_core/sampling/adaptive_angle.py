"""Adaptive sampling of the directions of dense points (Huang & Ramamoorthi 2010, section 4.2).

A regular grid of every second row and column of the cube map is traced first. Where the samples
inside a window around another direction disagree, that direction is a *feature* and is traced as
well; where they agree it borrows their value. Visibility is one bit, so "their variance is not
zero" means that some are seen and some are blocked.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from prt_core.runtime.progress import Progress
from prt_core.sphere import FACES
from prt_core.transport.visibility import horizon_bits, unpack

# Points whose directions are chosen at once.
_BLOCK = 4096


@dataclass
class AdaptiveRows:
    """Rows of the visibility whose directions were sampled adaptively.

    Attributes
    ----------
    bits, traced, features : (n, n_bytes) uint8
        Visibility, the entries whose ray was cast, and those among them whose window holds seen
        and blocked samples.
    """

    bits: np.ndarray
    traced: np.ndarray
    features: np.ndarray


class AngularGrid:
    """The quarter grid of a cube map and the window of grid samples around each direction.

    Parameters
    ----------
    cube_map : CubeMap
    window : int
        Texels along the edge of the window, odd.

    Attributes
    ----------
    grid : (n_grid,) int64
        Directions on even rows and columns of each face: a quarter of all.
    on_grid : (n_directions,) bool
    """

    def __init__(self, cube_map, window=7):
        self.cube_map, self.window = cube_map, window
        n = cube_map.resolution
        _, row, column = np.unravel_index(np.arange(cube_map.n_directions), (6, n, n))
        self.on_grid = (row % 2 == 0) & (column % 2 == 0)
        self.grid = np.flatnonzero(self.on_grid)

    @cached_property
    def neighbours(self):
        """(n_directions, n_most) int64: places in `grid` inside each window.

        Windows go on across the edges of a face as if the cube were unfolded there; past a corner
        of the cube there is nothing. Shorter lists repeat their first entry.
        """
        texels = windows(self.cube_map, self.window)
        inside = (texels >= 0) & self.on_grid[texels]
        place = np.cumsum(self.on_grid) - 1
        most = int(inside.sum(axis=1).max())
        order = np.argsort(~inside, axis=1, kind="stable")[:, :most]
        picked = np.take_along_axis(texels, order, axis=1)
        valid = np.take_along_axis(inside, order, axis=1)
        return place[np.where(valid, picked, picked[:, :1])]

    def disagreement(self, seen, blocked):
        """Where windows hold seen samples, and where blocked ones.

        Parameters
        ----------
        seen, blocked : (n, n_bytes) uint8
            Bits of the grid's directions. Neither is set for a sample below the horizon: it says
            nothing.

        Returns
        -------
        any_seen, any_blocked : (n, n_bytes) uint8
        """
        return tuple(self._any(bits) for bits in (seen, blocked))

    def _any(self, bits):
        values = unpack(bits, self.cube_map.n_directions, np.uint8)[:, self.grid]
        # Packed along the points, so that one row of bytes serves eight of them.
        rows = np.packbits(np.ascontiguousarray(values.T), axis=1)
        near = rows[self.neighbours[:, 0]]
        for column in self.neighbours.T[1:]:
            near |= rows[column]
        spread = np.unpackbits(near, axis=1, count=len(values)).T
        return np.packbits(spread, axis=1, bitorder="little")


def windows(cube_map, window):
    """Texels of the square window around each texel, (n_directions, window^2) int64.

    Unfolded across the edges of the cube; -1 past its corners, where no texel is.
    """
    n = cube_map.resolution
    reach = min(window // 2, n)
    index = np.arange(-reach, n + reach)
    v, u = np.meshgrid((2 * index + 1) / n - 1, (2 * index + 1) / n - 1, indexing="ij")
    over_u, over_v = np.maximum(np.abs(u) - 1, 0), np.maximum(np.abs(v) - 1, 0)
    outside = (over_u > 0) & (over_v > 0)
    folded = np.stack([1 - over_u - over_v, np.clip(u, -1, 1), np.clip(v, -1, 1)], axis=-1)
    result = np.empty((6, n, n, 2 * reach + 1, 2 * reach + 1), np.int64)
    for face in range(6):
        texels = cube_map.texel_of(folded.reshape(-1, 3) @ FACES[face])
        wide = np.where(outside, -1, texels.reshape(outside.shape))
        result[face] = np.lib.stride_tricks.sliding_window_view(wide, (2 * reach + 1,) * 2)
    return result.reshape(cube_map.n_directions, -1)


def adaptive_steps(scene, tracer, points, grid):
    """Sample rows of the visibility adaptively; a generator of `Progress`.

    Parameters
    ----------
    scene : Scene
    tracer : Tracer
    points : (n,) int
    grid : AngularGrid

    Returns
    -------
    AdaptiveRows
    """
    cube_map = grid.cube_map
    shape = len(points), -(-cube_map.n_directions // 8)
    rows = AdaptiveRows(*(np.empty(shape, np.uint8) for _ in range(3)))
    on_grid = np.packbits(grid.on_grid, bitorder="little")
    for first in range(0, len(points), _BLOCK):
        block = slice(first, min(first + _BLOCK, len(points)))
        above = horizon_bits(scene, cube_map, points[block])
        sampled = above & on_grid
        seen = yield from tracer.trace(points[block], sampled)
        any_seen, any_blocked = grid.disagreement(seen, sampled & ~seen)
        # Where no sample of the window is above the horizon there is nothing to borrow.
        doubtful = above & ~on_grid & ~(any_seen ^ any_blocked)
        refined = yield from tracer.trace(points[block], doubtful)
        borrowed = above & ~on_grid & ~doubtful & any_seen
        rows.bits[block] = seen | refined | borrowed
        rows.traced[block] = sampled | doubtful
        rows.features[block] = above & any_seen & any_blocked
        yield Progress("dense", block.stop, len(points))
    return rows
