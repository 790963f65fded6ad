"""Relighting by triple products: light, visibility and reflectance, each in wavelets of its own.

`B(x, o) = sum over texels of L V(x) rho(x, o)`, where light and view both change (Ng et al. 2004).
The light keeps its largest wavelets, so does each lobe of a table; of the visibility only what
these ask for is read: sums and differences of squares, counted from its bits. The product of light
and lobe is made in wavelets (`multiplication_matrix`), once for all points that share a lobe, and
then summed against the visibility. The few brightest texels would need the finest wavelets of all
three: they are taken out of the light and added exactly, from their bits.
"""

import numpy as np
import scipy.sparse as sp

from prt_core.basis.haar import haar_rows
from prt_core.basis.triple_product import HaarSquares, multiplication_matrix
from prt_core.errors import expect, expect_array, expect_kind
from prt_core.reflectance.lobe_table import LobeTable, kept_wavelets
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import CubeMap
from prt_core.transport.bright_texels import BrightTexels, bits_of
from prt_core.transport.visibility import UNIT, expect_bits, unpack

# Points that are prepared together; those for which light and lobes are multiplied together, and
# those that are summed with all lobes of any of them.
_UNPACK, _TOGETHER, _GROUP = 256, 1024, 64


class TripleProducts:
    """Points of one material, under light and views that both change.

    Parameters
    ----------
    bits : (n_points, n_bytes) uint8
        See `visibility_bits`.
    normals : (n_points, 3) float
    cube_map : CubeMap
        With 2^k times the blocks of the table along an edge.
    table : LobeTable
    reflectance_eval : callable
        What the table is of, for the brightest texels.
    light_kept : float
        Share of the light's wavelets that are kept.
    n_bright : int
        Texels that are taken out of the light.
    """

    def __init__(
        self, bits, normals, cube_map, table, reflectance_eval, light_kept=0.01, n_bright=32
    ):
        self.cube_map = expect_kind("cube_map", cube_map, CubeMap)
        self.bits = expect_bits("bits", bits, cube_map.n_directions)
        shape = len(bits), 3
        self.normals = expect_array("normals", normals, shape, np.float64, -UNIT, UNIT)
        self.table = expect_kind("table", table, LobeTable)
        blocks, n = table.cube_map.resolution, cube_map.resolution
        times = n // blocks
        expect(
            times * blocks == n and times & (times - 1) == 0,
            f"cube_map: expected 2^k times the {blocks} blocks of the table along an edge, got {n}",
        )
        self.n_kept = kept_wavelets(light_kept, cube_map.n_directions)
        self.bright = BrightTexels(bits, normals, cube_map, reflectance_eval, n_bright)
        self._squares = HaarSquares(n)
        self._coarse = self._places_of_blocks(blocks)
        self._counts = self._count(blocks)
        self._light = None

    def _places_of_blocks(self, blocks):
        """Of the wavelets of the table's blocks, in a row of the whole cube map."""
        n = self.cube_map.resolution
        face, row, column = np.unravel_index(np.arange(6 * blocks**2), (6, blocks, blocks))
        return (face * n + row) * n + column

    def _count(self, blocks):
        """(n_points, 6 blocks^2) int16: differences, for each wavelet, of the bits in its square.

        A wavelet's coefficient is that divided by the side of the square.
        """
        n, side = self.cube_map.resolution, self.cube_map.resolution // blocks
        n_coarse = 6 * blocks**2
        counts = np.empty((len(self.bits), n_coarse), np.int16)
        sides = self._squares.side[self._coarse].astype(np.float32) / side

        def one(first):
            part = slice(first, first + _UNPACK)
            seen = unpack(self.bits[part], self.cube_map.n_directions, np.uint8)
            seen = seen.reshape(-1, 6, blocks, side, blocks, side)
            seen = seen.sum(axis=5, dtype=np.uint16).sum(axis=3, dtype=np.uint16)
            rows = haar_rows(seen.reshape(-1, n_coarse).astype(np.float32), blocks)
            counts[part] = np.rint(rows * sides)

        expect(n * n < 1 << 15, f"cube_map: expected a resolution below 182, got {n}")
        on_all_cores(one, range(0, len(self.bits), _UNPACK))
        return counts

    def set_light(self, light):
        """Take a light.

        Parameters
        ----------
        light : (n_directions, n_channels) float
            Radiance of the texels.

        Returns
        -------
        self
        """
        rest = self.bright.split(light)
        self._n_channels = rest.shape[1]
        n = self.cube_map.resolution
        wavelets = haar_rows(np.ascontiguousarray(rest.T), n)
        # Of two wavelets alike the one of the larger square counts for more points and lobes.
        weight = np.abs(wavelets).max(axis=0) * self._squares.side
        kept = np.argsort(-weight, kind="stable")[: self.n_kept]
        fine = np.setdiff1d(kept, self._coarse)
        columns = np.concatenate([self._coarse, fine])
        self._fine = self._fine_counts(fine)
        # A lobe of even blocks of `side`^2 texels has its wavelets' coefficients over `side`.
        side = n / self.table.cube_map.resolution
        divided = (self._squares.side[columns] * side)[None]
        matrices = []
        for row in wavelets:
            cut = np.zeros_like(row)
            cut[kept] = row[kept]
            matrix = multiplication_matrix(cut, n)[self._coarse][:, columns]
            matrices.append(matrix.multiply(1 / divided))
        self._light = sp.hstack(matrices, "csr").astype(np.float32)
        return self

    def _fine_counts(self, places):
        """(n_points, m) int16, as `_counts`, of wavelets of squares within the table's blocks."""
        squares, n = self._squares, self.cube_map.resolution
        counts = np.zeros((len(self.bits), len(places)), np.int16)
        for column, place in enumerate(places):
            side, kind = int(squares.side[place]), squares.kind[place]
            first = squares.row[place] * side, squares.column[place] * side
            row, right = np.divmod(np.arange(side * side), side)
            texels = (squares.face[place] * n + first[0] + row) * n + first[1] + right
            down, across = (1 - 2 * (x >= side // 2) for x in (row, right))
            sign = (across, down, across * down)[kind].astype(np.int16)
            counts[:, column] = bits_of(self.bits, texels) @ sign
        return counts

    def toward(self, outgoing):
        """Radiance toward a view, under the light that was set.

        Parameters
        ----------
        outgoing : (n_points, 3) float
            Unit vectors from the points to the viewer (see `View.outgoing`).

        Returns
        -------
        (n_points, n_channels) float32
            Of the channels of the light or of the reflectance, whichever has more. Backs are black.
        """
        expect(self._light is not None, "light: none is set; call set_light first")
        outgoing = expect_array("outgoing", outgoing, self.normals.shape, np.float64, -UNIT, UNIT)
        n_channels = max(self._n_channels, self.table.n_channels)
        result = np.zeros((len(outgoing), n_channels), np.float32)
        facing = np.flatnonzero(np.einsum("ni,ni->n", self.normals, outgoing) > 0)
        keys, _, patch, scale = self.table.look_up(self.normals[facing], outgoing[facing])
        order = np.argsort(_along_curve(patch, self.table.n_mirrored), kind="stable")
        parts = [order[i : i + _TOGETHER] for i in range(0, len(order), _TOGETHER)]
        lobes = keys, scale.astype(np.float32)

        def one(part):
            points = facing[part]
            sums = self._summed(points, *(x[part] for x in lobes))
            result[points] = np.maximum(sums, 0) + self.bright.toward(points, outgoing[points])

        with one_blas_thread():
            on_all_cores(one, parts)
        return result

    def _summed(self, points, keys, scale):
        """(m, n_channels): wavelets of the visibility times those of light and lobe."""
        used, which = np.unique(keys, return_inverse=True)
        which = which.reshape(keys.shape)
        n_channels = self._n_channels
        products = (self.table.rows(used) @ self._light).toarray()
        products = products.reshape(len(used), n_channels, -1)
        counts = np.concatenate([self._counts[points], self._fine[points]], axis=1)
        counts = counts.astype(np.float32)
        sums = np.empty((len(points), n_channels, 4), np.float32)
        for first in range(0, len(points), _GROUP):
            part = slice(first, first + _GROUP)
            mine, place = np.unique(which[part], return_inverse=True)
            lobes = products[mine].reshape(len(mine) * n_channels, -1)
            values = (counts[part] @ lobes.T).reshape(-1, len(mine), n_channels)
            place = place.reshape(-1, 4, 1)
            sums[part] = np.take_along_axis(values, place, axis=1).swapaxes(1, 2)
        return (sums * scale).sum(axis=2)

    @property
    def nbytes(self):
        """Of what frames read: counts, bits, normals, the table."""
        arrays = self._counts, self.normals
        return sum(a.nbytes for a in arrays) + self.bright.nbytes + self.table.nbytes


def _along_curve(texels, n):
    """Numbers by which texels (m,) of n x n to a face are in order along a curve that winds."""
    face, row, column = np.unravel_index(texels, (6, n, n))
    result = face.astype(np.int64)
    for bit in reversed(range(int(n - 1).bit_length())):
        result = (result << 2) | (row >> bit & 1) << 1 | (column >> bit & 1)
    return result
