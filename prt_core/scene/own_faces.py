"""The faces of points that stand for several: each of their bounce rays leaves one of them.

Where a coarse mesh is shaded smooth, corners of faces that look in different directions are one
point. Cycles bounces no light to a corner from below the corner's own face, so that each of them
loses another part of what surrounds the point, and the mean of them a share of all of it. So a ray
belongs to a face that is chosen at random among those around its point.
"""

import numpy as np

# Cosine between a face and its point's geometric normal below which a point is bent: 20 degrees.
# The loss grows with the square of the angle, and of points that bend less it is below the error
# that bounces are allowed; between the corners, where the light that they send is too, it is less.
_BENT = 0.94
# Triangles looked at together.
_TRIANGLES = 1 << 16


class OwnFaces:
    """Normals of the faces around the bent points of a scene.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene):
        points = scene.points
        self._bent = np.zeros(len(points), bool)
        for point, normal in _sides(scene):
            along = np.einsum("ix,ix->i", normal, points.geometric_normals[point])
            self._bent[point[along < _BENT]] = True
        point, normal = np.zeros(0, scene.lattice.dtype), np.zeros((0, 3), np.float32)
        if self._bent.any():
            kept = [(p[self._bent[p]], n[self._bent[p]]) for p, n in _sides(scene)]
            point, normal = map(np.concatenate, zip(*kept, strict=True))
        order = np.argsort(point, kind="stable")
        self._normals = normal[order]
        self._count = np.bincount(point, minlength=len(points))
        self._first = np.cumsum(self._count) - self._count

    def below(self, points, directions, rng):
        """Which rays leave their point below the face, of those around it, that each belongs to.

        Parameters
        ----------
        points : slice
        directions : (n, n_rays, 3) float32
        rng : numpy.random.Generator
            From which nothing is drawn where no point is bent.

        Returns
        -------
        (n, n_rays) bool
        """
        result = np.zeros(directions.shape[:2], bool)
        bent = np.flatnonzero(self._bent[points])
        if len(bent):
            count, first = self._count[points][bent, None], self._first[points][bent, None]
            chance = rng.random((len(bent), directions.shape[1]))
            normals = self._normals[first + (chance * count).astype(np.int64)]
            result[bent] = np.einsum("irx,irx->ir", normals, directions[bent]) <= 0
        return result


def _sides(scene):
    """(m,) points of triangles and (m, 3) the normals of the sides: fronts, then backs, by parts.

    All at once they would take more memory than all that is known of the points.
    """
    sizes, starts = scene.lattice_sizes, scene.lattice_start
    for lattice, sign in ((scene.lattice, 1), (scene.lattice_back, -1)):
        for first in range(0, len(sizes), _TRIANGLES):
            part = slice(first, first + _TRIANGLES)
            count = sizes[part]
            inside = slice(int(starts[first]), int(starts[first]) + int(count.sum()))
            points = lattice[inside]
            sided = points >= 0
            if sided.any():
                normals = sign * np.repeat(scene.triangle_normals[part], count, axis=0)
                yield points[sided], normals[sided]
