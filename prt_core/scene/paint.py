"""What surfaces look like between their corners, and what a bake point stands for.

An image on a face of two triangles may differ everywhere from the colours of its four corners.
Bake points inside a face take the materials of their own place; and any point bounces by the mean
over the area around it, weighted as K shares it out, for light that meets the face does so
everywhere.
"""

from typing import Protocol

import numpy as np

from prt_core.reflectance import QUANTITIES, Materials
from prt_core.scene.lattice import lattice_of_hits

# Samples along an edge of a lattice cell, and of all cells together, at most.
_ALONG, _ALL = 32, 1 << 23
_BLOCK = 1 << 19


class Paint(Protocol):
    """The materials of a mesh anywhere on its faces; `Mesh.paint`, where corners do not tell."""

    def at(self, corners, weights):
        """Name -> (m, n_channels) float64 of what is painted, at places.

        Parameters
        ----------
        corners : (m, 3) int
            Of a face.
        weights : (m, 3) float
        """

    def texels(self, corners):
        """(m,) float: about how many different colours lie between each three corners."""

    def digest(self):
        """bytes that tell equal paints from others."""


class Surfaces:
    """The materials of a scene's meshes, anywhere on their triangles.

    Parameters
    ----------
    stacked : dict of arrays
        All meshes, one after the other (see `Scene.from_meshes`).
    paints : list of Paint or None
        Of each mesh.
    first_corner : list of int
        Of each mesh.
    """

    def __init__(self, stacked, paints, first_corner):
        self._corners = stacked["triangle_corners"].astype(np.int64)
        self._materials = stacked["materials"]
        self._object = stacked["triangle_object"].astype(np.int64)
        self._paints, self._first = paints, first_corner
        self.painted = np.array([paint is not None for paint in paints], bool)[self._object]

    def at(self, triangle, barycentric):
        """`Materials` at places: (m,) triangles, (m, 2) weights of the 2nd and 3rd corner."""
        second, third = np.asarray(barycentric, np.float64).T
        weights = np.stack([1 - second - third, second, third], axis=1)
        corners = self._corners[triangle]
        materials = self._materials.between(corners, weights)
        owners = self._object[triangle]
        for owner in np.unique(owners[self.painted[triangle]]):
            mine = owners == owner
            painted = self._paints[owner].at(corners[mine] - self._first[owner], weights[mine])
            for name, values in painted.items():
                getattr(materials, name)[mine] = QUANTITIES[name].settled(values)
        return materials

    def quantity_at(self, name, triangle, barycentric):
        """(m, n_channels) float64: one quantity of the materials at places (see `at`)."""
        if self.painted[triangle].any():
            return getattr(self.at(triangle, barycentric), name)
        second, third = np.asarray(barycentric, np.float64).T
        weights = np.stack([1 - second - third, second, third], axis=1)
        values = getattr(self._materials, name)[self._corners[triangle]]
        return QUANTITIES[name].settled(np.einsum("mk,mkc->mc", weights, values))

    def mean(self, levels, lattice_start, lattice, materials):
        """What each bake point stands for.

        Parameters
        ----------
        levels, lattice_start : (n_triangles,) int
        lattice : (n,) int
        materials : Materials
            Of the points; what is taken where no painted triangle is around one.

        Returns
        -------
        Materials
        """
        painted = np.flatnonzero(self.painted)
        if not len(painted):
            return materials
        along = self._samples_along(painted, levels[painted])
        total = np.zeros(len(materials))
        sums = materials.map(lambda _, values: np.zeros(values.shape))
        for level, count in np.unique(np.stack([levels[painted], along], axis=1), axis=0):
            alike = painted[(levels[painted] == level) & (along == count)]
            places = _centroids(int(level * count))
            cell, weights = lattice_of_hits(np.full(len(places), level), places)
            each = max(1, _BLOCK // len(places))
            for first in range(0, len(alike), each):
                part = alike[first : first + each]
                sampled = self.at(np.repeat(part, len(places)), np.tile(places, (len(part), 1)))
                points = lattice[lattice_start[part][:, None, None] + cell]
                share = np.broadcast_to(weights, points.shape).ravel().astype(np.float64)
                total += np.bincount(points.ravel(), share, len(total))
                for name, values in sampled.arrays().items():
                    for channel, column in enumerate(values.T):
                        value = np.repeat(column, 3) * share
                        summed = np.bincount(points.ravel(), value, len(total))
                        getattr(sums, name)[:, channel] += summed
        means = sums.map(
            lambda quantity, summed: quantity.settled(summed / np.maximum(total, 1e-30)[:, None])
        )
        return Materials(
            **{
                name: np.where(total[:, None] > 0, getattr(means, name), values)
                for name, values in materials.arrays().items()
            }
        )

    def opacity_cells(self, sloping):
        """Into how many cells along an edge opacity asks triangles to be cut.

        Parameters
        ----------
        sloping : int
            Where corners differ.

        Returns
        -------
        (n_triangles,) int64
            0 where a triangle is known to be opaque.
        """
        opacity = self._materials.opacity[:, 0]
        corners = opacity[self._corners] if (opacity < 1).any() else np.ones((1, 3))
        even, clear = np.ptp(corners, axis=1) == 0, (corners < 1).any(axis=1)
        cells = np.where(clear, np.where(even, 1, sloping), 0)
        cells = np.array(np.broadcast_to(cells, len(self._corners)))
        for owner in np.unique(self._object[self.painted]):
            mine = np.flatnonzero(self._object == owner)
            paint, one = self._paints[owner], self._corners[mine[:1]] - self._first[owner]
            # What paint does not say of one place it says of none.
            if "opacity" in paint.at(one, np.full((1, 3), 1 / 3)):
                cells[mine] = np.ceil(np.sqrt(2 * np.maximum(self._texels(mine), 1)))
        return cells

    def _texels(self, triangles):
        """(n,) float: about how many colours lie in each painted triangle."""
        texels = np.zeros(len(triangles))
        owners = self._object[triangles]
        for owner in np.unique(owners):
            mine = owners == owner
            corners = self._corners[triangles[mine]] - self._first[owner]
            texels[mine] = self._paints[owner].texels(corners)
        return texels

    def _samples_along(self, triangles, levels):
        """(n,) int: samples along an edge of each triangle's cells, as its texels ask for."""
        texels = self._texels(triangles)
        # Twice as many each way as there are texels, in a triangle that is half their square.
        along = 2 * np.sqrt(2 * np.maximum(texels, 0)) / levels
        fewer = np.sqrt(max(1.0, float(((levels * np.minimum(along, _ALONG)) ** 2).sum()) / _ALL))
        return np.clip(np.ceil(along / fewer), 1, _ALONG).astype(np.int64)


def _centroids(count):
    """(count^2, 2) barycentric places that cover a triangle evenly."""
    i, j = np.indices((count, count)).reshape(2, -1)
    upright = i + j < count
    turned = i + j < count - 1
    places = np.concatenate(
        [
            np.stack([i[upright] + 1 / 3, j[upright] + 1 / 3], axis=1),
            np.stack([i[turned] + 2 / 3, j[turned] + 2 / 3], axis=1),
        ]
    )
    return places / count
