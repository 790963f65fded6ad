"""Points that a light field is captured at: where rays towards them end, and where they start.

At a vertex, where facets meet, rounding decides what a ray meets. So a ray ends a little inwards,
towards the middle of the facets around the point: inside of a solid where that is convex, away
from the rim of a sheet. It starts as high above as it must to be outside.
"""

from dataclasses import dataclass, fields

import numpy as np

# How far inwards rays end, as a share of the way to the middle of the facets.
_INWARD = 0.02
# How far above that they start at least, as a share of the same way.
_ABOVE = 1e-3
# What float32 can tell apart, as a share of a coordinate; and in units, what Cycles skips before a
# camera, which is where none can be nearer.
_GRAIN, _NEAR = 4e-6, 4e-6
# How far from its place a ray may end, in ways to the middle of the facets, and in heights above.
_REACH, _SLANT = 1.0, 20.0


@dataclass(frozen=True)
class FieldPoints:
    """Places of a light field, in the world.

    Attributes
    ----------
    point : (n,) int32
        The bake point of each.
    positions : (n, 3) float64
        Where rays end.
    frames : (n, 3, 3) float64
        Two tangents and the normal as rows, right-handed: the hemisphere's axes.
    above : (n, 3) float64
        Along the normal of the facets, as long as rays start above them.
    reach : (n,) float64
        How far from its place a ray may end and have met the point.
    """

    point: np.ndarray
    positions: np.ndarray
    frames: np.ndarray
    above: np.ndarray
    reach: np.ndarray

    def __len__(self):
        return len(self.point)

    def __getitem__(self, part):
        """Some of them, by a slice or indices."""
        return FieldPoints(*(getattr(self, field.name)[part] for field in fields(self)))


def field_points(scene, point, frames):
    """The `FieldPoints` of some bake points.

    Parameters
    ----------
    scene : Scene
    point : (n,) int
    frames : (n, 3, 3) float
    """
    points = scene.points
    inward, way = _inward(scene)
    positions = points.positions[point] + _INWARD * inward[point]
    geometric = points.geometric_normals[point].astype(np.float64)
    geometric /= np.linalg.norm(geometric, axis=1, keepdims=True)
    sunk = np.einsum("nx,nx->n", points.positions[point] - positions, geometric)
    places = scene.to_world(positions)
    lift = np.maximum(_ABOVE * way[point], np.linalg.norm(points.ray_offset[point], axis=1))
    lift = np.maximum(lift * scene.size, _GRAIN * np.abs(places).max(axis=1) + _NEAR)
    height = np.maximum(sunk, 0) * scene.size + lift
    return FieldPoints(
        np.asarray(point, np.int32),
        places,
        np.asarray(frames, np.float64),
        height[:, None] * geometric,
        _REACH * way[point] * scene.size + _SLANT * height,
    )


def _inward(scene):
    """(n_points, 3): the way to the middle of the facets around; (n_points,): the mean length.

    Points that lie within a facet have none.
    """
    sizes = scene.lattice_sizes
    owner = np.repeat(np.arange(len(scene.triangles)), sizes)
    middle = scene.vertices[scene.triangles].mean(axis=1)[owner]
    level = scene.triangle_level[owner].astype(np.float64)
    total, length = np.zeros((len(scene.points), 3)), np.zeros(len(scene.points))
    count = np.zeros(len(scene.points))
    for lattice in (scene.lattice, scene.lattice_back):
        has = lattice >= 0
        which = lattice[has]
        ways = (middle[has] - scene.points.positions[which]) / level[has, None]
        for axis in range(3):
            total[:, axis] += np.bincount(which, ways[:, axis], len(total))
        length += np.bincount(which, np.linalg.norm(ways, axis=1), len(total))
        count += np.bincount(which, minlength=len(total))
    count = np.maximum(count, 1)
    return total / count[:, None], length / count
