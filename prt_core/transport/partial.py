"""Transport of which only some rows are known yet: the other points take their neighbours'.

What a known point receives from far away is kept as a vector, its irradiance in every orientation,
so that a neighbour takes of it what falls onto its own normal. Light between surfaces is gathered
by rays of some points alone, `H`, which see all others, each in its own colour:

    E = n . (S e)               e: vector irradiance of the known points, n: normals of all
    B = albedo (E + S H B)      S: the shares in which each point takes from those around it

With every row known and every point's own rays both are what `Transport` has, bit for bit.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from prt_core.errors import expect, expect_array, expect_kind
from prt_core.sphere import CubeMap
from prt_core.transport.transport import Transport, is_grey
from prt_core.transport.visibility import expect_bits, vector_light


@dataclass(frozen=True)
class SpreadGather:
    """K of all points from that of some: `K x = S (H x)`.

    Attributes
    ----------
    spread : (n_points, n_known) CSR float32
        S: non-negative, rows sum to 1, or 0 where there is nobody to take from.
    gather : (n_known, n_points) CSR float32
        H: K of the known points (see `gather_operator`).
    """

    spread: sp.csr_matrix
    gather: sp.csr_matrix

    @property
    def shape(self):
        """(n_points, n_points)."""
        return self.spread.shape[0], self.gather.shape[1]

    def __matmul__(self, term):
        return self.spread @ (self.gather @ term)


@dataclass
class PartialTransport(Transport):
    """A `Transport` of which `bits` are the rows of some points only.

    It relights; rows, columns and single entries are those of a whole `Transport`.

    Attributes
    ----------
    cube_map : CubeMap
        On which light is given.
    bits : (n_known, n_bytes) uint8
        Visibility of the known points.
    gather : SpreadGather, (n_points, n_points) CSR float32, or None
    normals : (n_points, 3) float32
    materials, tolerance, bounces, mean_materials, opposite
        As those of a `Transport`, of all points.
    spread : (n_points, n_known) CSR float32, or None
        S; None: all rows are known, in the order of the points.
    row_map : CubeMap, or None
        Of `bits`, where that is not the one on which light is given.
    """

    spread: sp.csr_matrix | None = None
    row_map: CubeMap | None = None

    def __post_init__(self):
        expect_kind("cube_map", self.cube_map, CubeMap)
        if self.row_map is not None:
            expect_kind("row_map", self.row_map, CubeMap)
        expect_bits("bits", self.bits, self.directions_of_rows.n_directions)
        if self.spread is not None:
            good = sp.issparse(self.spread) and self.spread.shape[1] == len(self.bits)
            expect(good, "spread: expected a sparse matrix with a column for each known point")
        super().__post_init__()

    @property
    def directions_of_rows(self):
        """The `CubeMap` of `bits`."""
        return self.row_map or self.cube_map

    @property
    def is_coarse(self):
        """Whether some points take their rows from others."""
        return self.spread is not None

    @property
    def n_points(self):
        """All points, known or not."""
        return len(self.bits) if self.spread is None else self.spread.shape[0]

    def received(self, light):
        """Direct irradiance / pi of all points, (n_points, 3) float32, under `light`."""
        light = expect_array("light", light, (self.n_directions, None), np.float32)
        if self.spread is None:
            return super().received(light)
        narrow = light[:, :1] if is_grey(light) else light
        vectors = vector_light(self.bits, self.directions_of_rows, self.on_rows(narrow))
        around = self.spread @ vectors.reshape(len(vectors), -1)
        around = around.reshape(self.n_points, 3, narrow.shape[1])
        received = np.einsum("pa,pac->pc", self.normals.astype(np.float32), around)
        received = np.maximum(received, 0)
        return np.broadcast_to(received, (self.n_points, light.shape[1])).copy()

    def on_rows(self, light):
        """Light on the directions of the rows, (n_row_directions, k).

        Parameters
        ----------
        light : (n_directions, k) float
            Radiance; each row's direction has the mean of the texels within it.
        """
        if self.row_map is None:
            return light
        texel = self.row_map.texel_of(self.cube_map.directions)
        weight, n = self.cube_map.solid_angles, self.row_map.n_directions
        total = np.bincount(texel, weight, n)
        sums = [np.bincount(texel, weight * column, n) for column in light.T]
        return np.stack(sums, axis=1) / np.maximum(total, 1e-30)[:, None]
