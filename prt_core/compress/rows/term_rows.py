"""Rows of the transport of one in-out term: its factor times the cosine times the visibility."""

from functools import cached_property

import numpy as np

from prt_core.compress.rows.row_code import Group, RowCode, natural_scale
from prt_core.compress.rows.rows import Rows
from prt_core.errors import expect, expect_kind
from prt_core.sphere import CubeMap
from prt_core.transport.visibility import expect_bits, unpack


class TermRows(Rows):
    """Rows of one term, the same in every channel of the light.

    Parameters
    ----------
    bits : (n_points, n_bytes) uint8
        See `visibility_bits`.
    cube_map : CubeMap
    factor : callable(points, directions) -> (n, m) float32
        What the term takes where all is seen (see `TermFactor`).
    """

    def __init__(self, bits, cube_map, factor):
        expect_kind("cube_map", cube_map, CubeMap)
        self.bits = expect_bits("bits", bits, cube_map.n_directions)
        expect(callable(factor), "factor: expected a function of points and directions")
        self.factor = factor
        self.n_points, self.n_directions, self.n_outputs = len(bits), cube_map.n_directions, 3
        self.resolution = cube_map.resolution

    @cached_property
    def code(self):
        """The `RowCode` of the features: wavelets, weighed by how strong they are in lights."""
        group = Group((3**-0.5,) * 3, direct=True)
        scale = natural_scale(self.resolution)
        return RowCode(self.n_directions, self.reads, (group,), self.resolution, scale)

    def features(self, points):
        """See `Rows.features`."""
        return self.code.code(self.values(points) * np.float32(3**0.5))

    def values(self, points):
        """(n, n_directions) float32 of some `points`: T_k."""
        points = np.asarray(points)
        seen = unpack(self.bits[points], self.n_directions, np.uint8)
        return self.factor(points, slice(None)) * seen

    def block(self, points):
        """See `Rows.block`."""
        return self.code.decode(self.features(points))
