"""Seams of an atlas: where charts that lie apart in the image meet on the surface.

Both sides of a seam show the same light, but each is looked up between texels of its own. The
texels there are moved, as little as it takes, until both lookups agree: linear least squares over
lookups along all seams (Iwanicki 2013, "Lighting Technology of The Last of Us"; Sylvan 2017). A
seam is an edge of the mesh whose two faces are shaded alike there: across a hard edge light may
differ.
"""

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

# Lookups along a seam for each texel of its length.
_DENSITY = 2
# What it costs to move a texel, against a difference between the two sides.
_KEEP = 0.1
# Times that they are moved again, where some were cut at black.
_ROUNDS = 8
# Places in the image, in texels, that are the same.
_SAME_PLACE = 1e-3
# Normals and albedo that are the same on both sides, within rounding.
_SAME_NORMAL, _SAME_ALBEDO = 0.999, 0.01


@dataclass(frozen=True)
class Seams:
    """Bilinear lookups at the same places of the surface, on both sides of seams.

    Attributes
    ----------
    texel : (n_lookups, 8) int32
        Four of one side, then four of the other.
    weight : (n_lookups, 8) float32
        Those of the other side are negative.
    edge : (n_lookups,) int32
        The seam that each is on.
    """

    texel: np.ndarray
    weight: np.ndarray
    edge: np.ndarray

    @classmethod
    def of_edges(cls, sides, places, width, height, from_texel):
        """The seams at edges of the surface that lie in an image twice.

        Parameters
        ----------
        sides : (2, 2, n_edges) int
            Corners at both ends, of one side and of the other (see `common_edges`).
        places : (n, 3, 2) float
            Columns and rows of the corners of triangles in the image.
        width, height : int
        from_texel : (height * width,) int
            The texel whose light each shows.
        """
        flat = places.reshape(-1, 2)
        lookups = [(flat[start], flat[stop]) for start, stop in sides]
        length = np.maximum(*(np.linalg.norm(stop - start, axis=1) for start, stop in lookups))
        # What lies outside of the image is not looked up.
        inside = np.ones(len(length), bool)
        for start, stop in lookups:
            for end in (start, stop):
                inside &= ((end > -0.5) & (end < [width + 0.5, height + 0.5])).all(axis=1)
        count = np.where(
            inside, np.ceil(np.minimum(length, 1e5) * _DENSITY).astype(np.int64) + 1, 0
        )
        edge = np.repeat(np.arange(len(count)), count)
        along = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        along = (along / np.maximum(count[edge] - 1, 1))[:, None]
        texel, weight = zip(
            *(
                bilinear(start[edge] + along * (stop - start)[edge], width, height)
                for start, stop in lookups
            ),
            strict=True,
        )
        texel = from_texel[np.concatenate(texel, axis=1)].astype(np.int32)
        weight = np.concatenate([weight[0], -weight[1]], axis=1).astype(np.float32)
        return cls(texel, weight, edge.astype(np.int32))

    def differences(self, pixels):
        """(n_lookups, n_channels) float: one side less the other, of (height, width, n) pixels."""
        flat = pixels.reshape(-1, pixels.shape[-1])
        return np.einsum("mk,mkc->mc", self.weight, flat[self.texel])

    def error(self, pixels):
        """The relative L2 difference along each seam, against all lookups: (mean, worst).

        Parameters
        ----------
        pixels : (height, width, n_channels) float32

        Returns
        -------
        mean, worst : float
            Over all seams, and of the seam that differs most; 0 where there is none.
        """
        if not len(self.edge):
            return 0.0, 0.0
        squared = (self.differences(pixels) ** 2).sum(axis=1)
        flat = pixels.reshape(-1, pixels.shape[-1])
        sides = np.einsum("mk,mkc->mc", np.abs(self.weight), flat[self.texel]) / 2
        level = max((sides**2).sum(axis=1).mean(), 1e-30)
        number = np.bincount(self.edge)
        each = np.bincount(self.edge, squared) / np.maximum(number, 1)
        return float(np.sqrt(squared.mean() / level)), float(np.sqrt(each.max() / level))

    def mended(self, pixels, point):
        """The pixels with both sides of all seams alike.

        Parameters
        ----------
        pixels : (height, width, n_channels) float32
        point : (height * width,) int
            The bake point of each texel: those that share one stay alike.

        Returns
        -------
        (height, width, n_channels) float32
        """
        if not len(self.edge):
            return pixels
        flat = pixels.reshape(-1, pixels.shape[-1])
        lookups, solver, texels = self._system
        before = flat[texels].astype(np.float64)
        # Light has no negative values that it had not before: what is cut there others take over.
        least, values = np.minimum(before, 0), before
        for _ in range(_ROUNDS):
            values = values - solver.solve(lookups.T @ (lookups @ values))
            if (values >= least).all():
                break
            values = np.maximum(values, least)
        by_point = np.zeros((int(point.max()) + 1, flat.shape[1]))
        by_point[point[texels]] = values - before
        return (flat + by_point[point]).astype(pixels.dtype).reshape(pixels.shape)

    @cached_property
    def _system(self):
        texels, column = np.unique(self.texel, return_inverse=True)
        row = np.repeat(np.arange(len(self.edge)), 8)
        shape = len(self.edge), len(texels)
        lookups = sp.csr_matrix(
            (self.weight.ravel().astype(np.float64), (row, column.ravel())), shape
        )
        keep = sp.identity(len(texels), format="csc") * _KEEP**2
        return lookups, splu((lookups.T @ lookups + keep).tocsc()), texels


def common_edges(scene, source, places, points):
    """Edges of the surface at which two charts end, shaded alike and apart in the image.

    Parameters
    ----------
    scene : Scene
    source : (n,) int
        Triangles of the scene.
    places : (n, 3, 2) float
        Columns and rows of their corners in the image.
    points : (n, 3) int
        Bake points of their corners.

    Returns
    -------
    sides : (2, 2, n_edges) int64
        Of one side and of the other: the corners at both ends, 3 t + k is corner k of triangle t.
    """
    border = uv_edges(places, points).border
    here, there = border, border - border % 3 + (border + 1) % 3
    vertices = scene.triangles[source]
    _, same = np.unique(scene.vertices[vertices.ravel()], axis=0, return_inverse=True)
    ends = np.sort(np.stack([same.ravel()[here], same.ravel()[there]]), axis=0)
    order = np.lexsort(ends)
    new = np.ones(len(order), bool)
    new[1:] = (np.diff(ends[:, order], axis=1) != 0).any(axis=0)
    group = np.cumsum(new) - 1
    # Two borders at the same edge of the surface; of more, no two belong to each other.
    two = np.flatnonzero(np.bincount(group, minlength=1) == 2)
    first = np.searchsorted(group, two)
    one, other = order[first], order[first + 1]
    a, b = _ends(here[one], there[one], same), _ends(here[other], there[other], same)
    alike = _alike(scene, points, a[0], b[0]) & _alike(scene, points, a[1], b[1])
    flat = places.reshape(-1, 2)
    # Where both sides lie in the same place, as at doubled vertices, nothing is to be mended.
    shift = np.abs(flat[a[0]] - flat[b[0]]) + np.abs(flat[a[1]] - flat[b[1]])
    alike &= shift.max(axis=1, initial=0) > _SAME_PLACE
    return np.array([a, b])[:, :, alike]


def uv_edges(places, points):
    """Edges of triangles in an image, of which those on a border belong to one triangle.

    Parameters
    ----------
    places : (n, 3, 2) float
    points : (n, 3) int
        Bake points of their corners.

    Returns
    -------
    SimpleNamespace
        `border` (m,) int64: 3 t + k is the edge of triangle t from its corner k to the next.
    """
    key = np.column_stack([places.reshape(-1, 2), points.ravel()])
    _, corner = np.unique(key, axis=0, return_inverse=True)
    corner = corner.reshape(-1, 3)
    pairs = np.sort(np.stack([corner, np.roll(corner, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, edge, number = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    return SimpleNamespace(border=np.flatnonzero(number[edge.ravel()] == 1))


def bilinear(places, width, height):
    """The four texels around places of an image and their weights, clamped at its edges.

    Parameters
    ----------
    places : (m, 2) float
        Columns and rows; the middle of the first texel is at (0.5, 0.5).
    width, height : int

    Returns
    -------
    texel : (m, 4) int64
    weight : (m, 4) float64
    """
    low = np.floor(places - 0.5)
    share = places - 0.5 - low
    column, row = low.astype(np.int64).T
    columns = np.clip(np.stack([column, column + 1, column, column + 1], axis=1), 0, width - 1)
    rows = np.clip(np.stack([row, row, row + 1, row + 1], axis=1), 0, height - 1)
    u, v = share.T
    weight = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)
    return rows * width + columns, weight


def _ends(here, there, same):
    """Corners of edges, in the order of the vertices that both sides share."""
    turn = same.ravel()[here] > same.ravel()[there]
    return np.where(turn, there, here), np.where(turn, here, there)


def _alike(scene, points, one, other):
    """Whether two corners are shaded alike: then both sides receive the same light."""
    one, other = points.ravel()[one], points.ravel()[other]
    normals, albedo = scene.points.normals, scene.points.materials.albedo
    near = np.einsum("mx,mx->m", normals[one], normals[other]) > _SAME_NORMAL
    return (one == other) | (
        near & (np.abs(albedo[one] - albedo[other]) < _SAME_ALBEDO).all(axis=1)
    )
