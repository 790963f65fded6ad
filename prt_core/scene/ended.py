"""How much of its light a surface shows by the rays that end at it.

Radiance of points is of all light that arrives, also of that which goes straight through. Of rays
at what lets light pass only a share ends there (see `rays.passing`), so each shows that much more.
"""

import numpy as np


def ended_share(scene, triangle, barycentric, back, points, weights):
    """The share of rays that end where these did, by which what they show is divided.

    Glass is shown by what it lets through as well, as if that ended there too.

    Parameters
    ----------
    scene : Scene
    triangle : (m,) int
    barycentric : (m, 2) float
        Weights of the second and third corner.
    back : (m,) bool
        Whether the back was met.
    points : (m, 3) int
        Around each hit; -1 where its side returns no light.
    weights : (m, 3) float

    Returns
    -------
    (m,) float32
        Above 0, at most 1.
    """
    share = np.ones(len(triangle), np.float32)
    if scene.opacity is None:
        return share
    some = np.flatnonzero(scene.opacity.passing[triangle])
    ended = scene.opacity.at(triangle[some], barycentric[some], back[some])
    glass = scene.points.materials.transmission.mean(axis=1)[points[some]]
    ended += np.einsum("mk,mk->m", weights[some], np.where(points[some] >= 0, glass, 0))
    share[some] = np.where(ended > 0, np.minimum(ended, 1), 1)
    return share


def ended_at(materials):
    """The same of places that are known by their materials alone.

    Parameters
    ----------
    materials : Materials
        Of n places.

    Returns
    -------
    (n,) float32
        Above 0, at most 1.
    """
    ended = (materials.opacity[:, 0] + materials.transmission.mean(axis=1)).astype(np.float32)
    return np.where(ended > 0, np.minimum(ended, 1), np.float32(1))
