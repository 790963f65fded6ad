"""Square blocks of a cube map's texels: one number for many directions that lie together."""

from functools import cached_property

import numpy as np

from prt_core.errors import expect, expect_kind, expect_whole
from prt_core.sphere.cubemap import CubeMap


class Blocks:
    """The texels of a cube map in square blocks.

    Parameters
    ----------
    cube_map : CubeMap
    side : int
        Blocks along an edge of a face; divides the resolution.

    Attributes
    ----------
    directions : (n_blocks, 3) float64
        Unit vectors towards their middles.
    solid_angles : (n_blocks,) float64

    Raises
    ------
    PRTError
        The side does not divide the resolution.
    """

    def __init__(self, cube_map, side):
        self.cube_map = expect_kind("cube_map", cube_map, CubeMap)
        self.side = expect_whole("side", side, 1, cube_map.resolution)
        expect(
            cube_map.resolution % side == 0,
            f"side: expected a divisor of the {cube_map.resolution} texels of an edge, got {side}",
        )
        coarse = CubeMap(side)
        self.directions, self.solid_angles = coarse.directions, coarse.solid_angles
        self._texel_along = coarse.texel_along

    def __len__(self):
        return len(self.solid_angles)

    @property
    def n_texels(self):
        """Of each block."""
        return (self.cube_map.resolution // self.side) ** 2

    @cached_property
    def texels(self):
        """(n_blocks, n_texels) int32: the texels of each block, row by row."""
        n, step = self.cube_map.resolution, self.cube_map.resolution // self.side
        order = np.arange(6 * n * n, dtype=np.int32).reshape(6, self.side, step, self.side, step)
        return order.swapaxes(2, 3).reshape(len(self), step * step)

    @cached_property
    def of_texel(self):
        """(n_directions,) int32: the block of each texel."""
        owner = np.empty(self.cube_map.n_directions, np.int32)
        owner[self.texels] = np.arange(len(self), dtype=np.int32)[:, None]
        return owner

    def along(self, x, y, z):
        """The block that directions of components x, y, z fall into, as `CubeMap.texel_along`."""
        return self._texel_along(x, y, z)

    def patterns(self, bits):
        """The bits of each block side by side.

        Parameters
        ----------
        bits : (n, n_bytes) uint8
            One bit a texel of the cube map, little bit order.

        Returns
        -------
        (n, n_blocks, ceil(n_texels / 8)) uint8
            Texel t of a block, in the order of `texels`, is bit t % 8 of byte t // 8.
        """
        n, step = self.cube_map.resolution, self.cube_map.resolution // self.side
        if n % 8 == 0 and step in (1, 2, 4):
            return self._patterns_of_bytes(bits, step)
        spread = np.unpackbits(bits, axis=1, count=self.cube_map.n_directions, bitorder="little")
        spread = spread.reshape(-1, 6, self.side, step, self.side, step).swapaxes(3, 4)
        spread = spread.reshape(-1, len(self), self.n_texels)
        return np.packbits(spread, axis=2, bitorder="little")

    def _patterns_of_bytes(self, bits, step):
        """The same where bytes hold whole rows of blocks: ten times as quick."""
        rows = bits.reshape(-1, 6, self.side, step, self.cube_map.resolution // 8)
        patterns = np.zeros((*rows.shape[:3], rows.shape[4], 8 // step), "<u2")
        for row in range(step):
            for place in range(8 // step):
                part = (rows[:, :, :, row] >> (place * step)) & ((1 << step) - 1)
                patterns[..., place] |= part.astype(np.uint16) << (row * step)
        patterns = patterns.reshape(len(bits), len(self))
        if self.n_texels <= 8:
            return patterns.astype(np.uint8)[..., None]
        return patterns.view(np.uint8).reshape(len(bits), len(self), 2)

    def pattern_shares(self, patterns):
        """How much of the solid angle of each block the texels have whose bits are set.

        Parameters
        ----------
        patterns : (n, n_blocks, n_bytes) uint8
            See `patterns`.

        Returns
        -------
        (n, n_blocks) float32
            1 at most, but for rounding.
        """
        tables, base = self._share_tables, 256 * np.arange(len(self), dtype=np.int32)
        total = tables[0].take(base + patterns[..., 0], axis=0)
        for byte in range(1, patterns.shape[2]):
            total += tables[byte].take(base + patterns[..., byte], axis=0)
        return total

    @cached_property
    def _share_tables(self):
        whole = np.repeat(self.solid_angles, 256)
        return (self.pattern_tables(self.cube_map.solid_angles) / whole).astype(np.float32)

    def pattern_tables(self, values):
        """What each byte of a pattern adds up to.

        Parameters
        ----------
        values : (n_directions,) or (n_directions, k) float

        Returns
        -------
        (n_bytes, 256 n_blocks) or (n_bytes, 256 n_blocks, k) float32
        """
        values = np.asarray(values, np.float64)[self.texels]
        set_bits = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little")
        tables = [
            np.tensordot(values[:, first : first + 8], set_bits[:, : self.n_texels - first], (1, 1))
            for first in range(0, self.n_texels, 8)
        ]
        tables = [np.moveaxis(table, -1, 1).reshape(-1, *values.shape[2:]) for table in tables]
        return np.stack(tables).astype(np.float32)

    def sums(self, values):
        """Sums over the texels of each block.

        Parameters
        ----------
        values : (n_directions,) or (n_directions, k) float

        Returns
        -------
        (n_blocks,) or (n_blocks, k) array
        """
        return np.asarray(values)[self.texels].sum(axis=1)
