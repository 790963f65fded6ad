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


class OwnFaces:
    """Normals of the faces around the bent points of a scene.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene):
        points = scene.points
        point, normal = _sides(scene)
        along = np.einsum("ix,ix->i", normal, points.geometric_normals[point])
        self._bent = np.zeros(len(points), bool)
        self._bent[point[along < _BENT]] = True
        kept = np.flatnonzero(self._bent[point])
        kept = kept[np.argsort(point[kept], kind="stable")]
        self._normals = normal[kept]
        self._count = np.bincount(point[kept], minlength=len(points))
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
    """(m,) points of triangles, of both sides, and (m, 3) the normals of the sides."""
    normals = np.repeat(scene.triangle_normals, scene.lattice_sizes, axis=0)
    sided = scene.lattice_back >= 0
    points = np.append(scene.lattice, scene.lattice_back[sided])
    return points, np.concatenate([normals, -normals[sided]])
