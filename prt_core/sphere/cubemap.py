"""The directions of a bake: the texels of a cube map, with exact solid angles."""

from functools import cached_property

import numpy as np

from prt_core.errors import expect, expect_array, expect_whole

# Per face (+x, -x, +y, -y, +z, -z): the axis it looks along, and those of its columns and rows. A
# place (1, u, v) of a face is `place @ FACES[face]` in the world.
FACES = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
        [[0, 0, -1], [1, 0, 0], [0, -1, 0]],
    ],
    np.float64,
)
# Texels along a tile of strata.
_TILE = 8


class CubeMap:
    """6 x n x n directions, in the order face (+x, -x, +y, -y, +z, -z), row, column.

    Directions point from the surface to the light, in Blender's world axes (z up).

    Parameters
    ----------
    resolution : int
        Texels along an edge, n; n_directions = 6 n^2.

    Attributes
    ----------
    directions : (n_directions, 3) float64
        Unit vectors through the texel centres.
    solid_angles : (n_directions,) float64
        Exact; they sum to 4 pi.
    samples : (n_directions, 3) float64
        The direction inside each texel that is traced. Spread evenly over every row and column of
        texels, so that a straight edge of the scene which runs along a row does not cover or
        miss all of it at once, as it would the centres.
    vectors : (n_directions, 3) float64
        The exact integral of the direction over each texel: `normal @ vectors[d]` is the
        cosine-weighted solid angle of a texel above the horizon.
    """

    def __init__(self, resolution):
        self.resolution = expect_whole("resolution", resolution, 1, 1024)

    @property
    def n_directions(self):
        """Texels of all faces."""
        return 6 * self.resolution**2

    def _edges(self):
        """Texel edges on a face, from -1 to 1."""
        return np.linspace(-1, 1, self.resolution + 1)

    @cached_property
    def directions(self):
        edges = self._edges()
        centre = (edges[:-1] + edges[1:]) / 2
        v, u = np.meshgrid(centre, centre, indexing="ij")
        local = np.stack([np.ones_like(u), u, v], axis=-1).reshape(-1, 3)
        local /= np.linalg.norm(local, axis=1, keepdims=True)
        return np.concatenate([local @ face for face in FACES])

    @cached_property
    def samples(self):
        # Tiles of _TILE x _TILE texels: along each row the heights, along each column the widths
        # are a random order of equal strata. The same for every bake of a resolution.
        n = self.resolution
        faces, tiles = [], -(-n // _TILE)
        for index, face in enumerate(FACES):
            rng = np.random.default_rng([index, n])
            order = rng.permuted(np.tile(np.arange(_TILE), (2, tiles * tiles * _TILE, 1)), axis=-1)
            order = order.reshape(2, tiles, tiles, _TILE, _TILE)
            strata = np.stack([order[0].swapaxes(-1, -2), order[1]])
            strata = strata.swapaxes(2, 3).reshape(2, tiles * _TILE, tiles * _TILE)[:, :n, :n]
            offset = (strata + rng.random(strata.shape)) / _TILE
            row, column = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
            u, v = (np.stack([column, row]) + offset) / n * 2 - 1
            local = np.stack([np.ones_like(u), u, v], axis=-1).reshape(-1, 3)
            local /= np.linalg.norm(local, axis=1, keepdims=True)
            faces.append(local @ face)
        return np.concatenate(faces)

    def on_faces(self, u, v):
        """Vectors (6 x m, 3) float64 through the places (u, v) of every face, of any length.

        Parameters
        ----------
        u, v : (m,) float
            -1 to 1 on a face, along its columns and rows; further out they lie on others.
        """
        u = expect_array("u", u, (None,), np.float64)
        v = expect_array("v", v, (len(u),), np.float64)
        local = np.stack([np.ones_like(u), u, v], axis=-1)
        return np.concatenate([local @ face for face in FACES])

    @cached_property
    def solid_angles(self):
        edges = self._edges()
        v, u = np.meshgrid(edges, edges, indexing="ij")
        corner = np.arctan2(u * v, np.sqrt(u * u + v * v + 1))
        face = corner[1:, 1:] - corner[1:, :-1] - corner[:-1, 1:] + corner[:-1, :-1]
        return np.tile(face.ravel(), 6)

    @cached_property
    def vectors(self):
        # Over a spherical polygon the integral of the direction is half the sum, over its edges,
        # of the edge's angle times the unit normal of the edge's plane (Lambert).
        edges = self._edges()
        v, u = np.meshgrid(edges, edges, indexing="ij")
        corner = np.stack([np.ones_like(u), u, v], axis=-1)
        ring = [corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]]
        local = np.zeros((self.resolution, self.resolution, 3))
        for p, q in zip(ring, ring[1:] + ring[:1], strict=True):
            normal = np.cross(p, q)
            length = np.linalg.norm(normal, axis=-1, keepdims=True)
            angle = np.arctan2(length, (p * q).sum(axis=-1, keepdims=True))
            local += angle / 2 * normal / length
        return np.concatenate([local.reshape(-1, 3) @ face for face in FACES])

    def texel_of(self, directions):
        """The texel that each direction falls into.

        Parameters
        ----------
        directions : (m, 3) float
            Any length but zero.

        Returns
        -------
        (m,) int32
        """
        directions = expect_array("directions", directions, (None, 3), np.float64)
        expect(
            directions.any(axis=1).all(),
            "directions: a vector of length zero has no direction",
        )
        return self.texel_along(*directions.T)

    def texel_along(self, x, y, z):
        """`texel_of` of components x, y, z (m,), unchecked, in their own precision: (m,) int32."""
        n = self.resolution
        ax, ay, az = np.abs(x), np.abs(y), np.abs(z)
        on_x, on_z = ax >= np.maximum(ay, az), az > np.maximum(ax, ay)
        along = np.where(on_x, x, np.where(on_z, z, y))
        scale = n / 2 / along
        # What `FACES` says: to divide by the signed axis turns the sides round as it should.
        column = np.where(on_x, y * scale, x * np.where(on_z, np.abs(scale), -scale))
        row = np.where(on_z, y * scale, z * np.abs(scale))
        face = 2 - 2 * on_x.astype(np.int32) + 2 * on_z + (along < 0)
        column, row = (np.clip((c + n / 2).astype(np.int32), 0, n - 1) for c in (column, row))
        return (face * n + row) * n + column
