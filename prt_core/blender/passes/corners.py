"""Which corners are sampled: one of those that must look alike, and all where they do not.

A vertex on the edge of a check is black in one face and white in the next. So corners that have all
in common are looked at from two of their triangles, and each on its own where the two differ. Of a
chequer those two may be alike; from a third, at right angles to them, it is seen.
"""

import numpy as np

from prt_core.blender.passes.quantities import compared

_TOLERANCE = 1 / 64


class CornerGroups:
    """The corners of meshes in groups that look alike.

    Parameters
    ----------
    triangles : Triangles
    meshes : list of Mesh
    records : list of SurfaceRecord
        Of the meshes.
    """

    def __init__(self, triangles, meshes, records):
        self._triangles, self._meshes = triangles, meshes
        # One row for each corner of each triangle, and its group.
        n = 3 * len(triangles.mesh)
        self._group, self._even = np.zeros(n, np.int64), np.repeat(triangles.even, 3)
        first = 0
        for index, record in enumerate(records):
            mine = np.flatnonzero(np.repeat(triangles.mesh == index, 3))
            corner = triangles.corner.reshape(-1)[mine]
            key = record.key_of_corner[corner]
            even = self._even[mine]
            key[even] = record.slot_of_corner[corner[even]]
            _, group = np.unique(key, return_inverse=True)
            self._group[mine] = first + group
            first += group.max(initial=-1) + 1
        # The largest triangle of each group, and the one that looks the most away from it.
        order = np.argsort(np.repeat(triangles.area, 3), kind="stable")
        self._best = np.zeros(first, np.int64)
        self._best[self._group[order]] = order
        middle = np.repeat(triangles.corners.mean(axis=1), 3, axis=0)
        away = middle - triangles.corners.reshape(-1, 3)
        away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)
        against = np.einsum("nx,nx->n", away, away[self._best[self._group]])
        order = np.argsort(-against, kind="stable")
        self._other = np.zeros(first, np.int64)
        self._other[self._group[order]] = order
        self._second = np.flatnonzero((self._other != self._best) & ~self._even[self._best])
        order = np.argsort(-np.abs(against), kind="stable")
        self._aside = np.zeros(first, np.int64)
        self._aside[self._group[order]] = order
        other = (self._aside != self._best) & (self._aside != self._other)
        smooth = np.repeat(triangles.smooth, 3)[self._best]
        self._third = np.flatnonzero(other & ~self._even[self._best] & ~smooth)

    def _places(self, rows):
        weights = np.eye(3)[rows % 3]
        weights[self._even[rows]] = 1 / 3
        return rows // 3, weights

    def places(self):
        """Triangles and weights: one place of each group, then others of those that may vary."""
        others = self._other[self._second], self._aside[self._third]
        return self._places(np.concatenate([self._best, *others]))

    def split(self, values):
        """Triangles and weights of all corners of groups that do not look alike.

        Parameters
        ----------
        values : (n, n_columns) array
            Of `places`.
        """
        n = len(self._best)
        group = np.concatenate([self._second, self._third])
        one, two = compared(values[group]), compared(values[n:])
        largest = np.maximum(1, np.abs(one).max(axis=1, initial=0))
        apart = np.abs(one - two).max(axis=1, initial=0) > _TOLERANCE * largest
        split = np.zeros(n, bool)
        split[group[apart]] = True
        self._split = np.flatnonzero(split[self._group])
        return self._places(self._split)

    def values(self, values, of_split):
        """For each mesh: its corners that triangles use, and what they look like.

        Parameters
        ----------
        values, of_split : (n, n_columns) arrays
            Of `places` and of `split`.

        Returns
        -------
        list of (corners, values)
        """
        every = values[self._group]
        every[self._split] = of_split
        of_mesh = np.repeat(self._triangles.mesh, 3)
        corner = self._triangles.corner.reshape(-1)
        result = []
        for index in range(len(self._meshes)):
            mine = np.flatnonzero(of_mesh == index)
            used, first = np.unique(corner[mine], return_index=True)
            result.append((used, every[mine[first]]))
        return result
