"""Frames for float32: each part of a scene is cast near the zero of its own coordinates.

Ray casters compute in float32, whose steps grow with the coordinate: one kilometre from the zero
they are 0.06 mm, a thousand kilometres away 6 cm. Where one zero cannot serve all triangles
(villages far apart, a model beside a planet), each group of them gets a frame of its own, with its
own caster; a ray is handed to every frame whose box it meets, in coordinates of that frame.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.rays.boxes import boxes_around
from prt_core.rays.caster import MISS, Hits

# A frame serves what lies within so many feature sizes of its centre: there a step of float32 is
# at most an eight-thousandth of the feature.
_REACH = 2.0**14
# Frames at most: each costs a test of every ray. What is left then is served as well as it can be.
_MOST = 8
# The feature of a triangle is its edge, but for fine meshes of large objects: up to so many edges,
# where the object is so many times as large.
_EDGES, _OF_OBJECT = 16, 1 / 16
# Triangles gone through at once.
_TRIANGLES = 1 << 16


@dataclass(frozen=True)
class Frames:
    """Where float32 coordinates are counted from.

    Attributes
    ----------
    centres : (n_frames, 3) float64
    of_triangle : (n_triangles,) int32
    coarse : (n_triangles,) bool
        Triangles that lie too far from every centre for their size.
    """

    centres: np.ndarray
    of_triangle: np.ndarray
    coarse: np.ndarray

    def __len__(self):
        return len(self.centres)

    def of_some(self, triangles):
        """The `Frames` of triangles, by their numbers, without those that serve none."""
        used, frame = np.unique(self.of_triangle[triangles], return_inverse=True)
        return Frames(self.centres[used], frame.astype(np.int32), self.coarse[triangles])

    def local(self, vertices, triangles, part=slice(None)):
        """(n, 3, 3) float64: corners of a part of the triangles of vertices, each in its frame."""
        return vertices[triangles[part]] - self.centres[self.of_triangle[part]][:, None]


def one_frame(n_triangles):
    """The `Frames` of a scene that needs no other than its own."""
    # One number for all takes no room.
    of_triangle, coarse = (np.broadcast_to(kind(0), n_triangles) for kind in (np.int32, np.bool_))
    return Frames(np.zeros((1, 3)), of_triangle, coarse)


def precision_frames(vertices, triangles, triangle_object):
    """As few frames as serve all triangles.

    Parameters
    ----------
    vertices : (n_vertices, 3) float64
    triangles : (n_triangles, 3) int
    triangle_object : (n_triangles,) int
        Small features of one object are near each other.

    Returns
    -------
    Frames
        One, about the zero of the coordinates, wherever that is enough.
    """
    vertices, middle = np.asarray(vertices, np.float64), np.empty((len(triangles), 3))
    edge, boxes = np.empty(len(triangles)), []
    parts = [slice(n, n + _TRIANGLES) for n in range(0, len(triangles), _TRIANGLES)]
    for part in parts:
        corners = vertices[triangles[part]]
        low, high = corners.min(axis=1), corners.max(axis=1)
        middle[part], edge[part] = (low + high) / 2, (high - low).max(axis=1)
        boxes.append(boxes_around(triangle_object[part], low, high))
    extents = _extents(boxes)
    feature = np.maximum(
        edge, np.minimum(_EDGES * edge, _OF_OBJECT * extents[np.asarray(triangle_object)])
    )

    def home(centre, part):
        return np.abs(middle[part] - centre).max(axis=1) <= _REACH * feature[part]

    served = np.concatenate([home(0.0, part) for part in parts] or [np.zeros(0, bool)])
    if served.all():
        return one_frame(len(triangles))
    centres, frame = [np.zeros(3)], np.where(served, 0, -1)
    while len(centres) < _MOST and (frame < 0).any():
        left = np.flatnonzero(frame < 0)
        # The median place by fineness, and the triangle nearest to it: it at least is at home.
        place = [_weighted_median(x, 1 / feature[left]) for x in middle[left].T]
        centre = middle[left[np.abs(middle[left] - place).max(axis=1).argmin()]]
        frame[left[home(centre, left)]] = len(centres)
        centres.append(centre)
    centres, coarse = np.array(centres), frame < 0
    away = [np.abs(middle[coarse] - centre).max(axis=1) for centre in centres]
    frame[coarse] = np.argmin(away, axis=0)
    used, frame = np.unique(frame, return_inverse=True)
    return Frames(centres[used], frame.astype(np.int32), coarse)


def _extents(boxes):
    """(n_objects,) longest side of the box around each object, of boxes around parts of them."""
    n_objects = max((len(low) for low, _ in boxes), default=0)
    lowest = np.full((n_objects, 3), np.inf)
    highest = -lowest
    for low, high in boxes:
        part = slice(0, len(low))
        lowest[part] = np.minimum(lowest[part], low)
        highest[part] = np.maximum(highest[part], high)
    return (highest - lowest).max(axis=1)


def _weighted_median(values, weights):
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return values[order[np.searchsorted(total, total[-1] / 2)]]


class FramedCaster:
    """A `RayCaster` made of one for each frame; origins are float64.

    Parameters
    ----------
    factory : callable(vertices, triangles) -> RayCaster
    vertices : (n_vertices, 3) float64
    triangles : (n_triangles, 3) int32
    frames : Frames
    """

    def __init__(self, factory, vertices, triangles, frames):
        self._parts = []
        try:
            for number, centre in enumerate(frames.centres):
                which = np.flatnonzero(frames.of_triangle == number)
                used, local = np.unique(triangles[which], return_inverse=True)
                corners = (vertices[used] - centre).astype(np.float32)
                local = local.reshape(-1, 3).astype(np.int32)
                self._parts.append(_Part(centre, which, corners, factory(corners, local)))
        except BaseException:
            self.close()
            raise
        first = self._parts[0].caster
        self.name, self.batch, self.threads = first.name, first.batch, first.threads

    def occluded(self, origins, directions, distances=None):
        """See `RayCaster`."""
        origins, directions = np.asarray(origins), np.asarray(directions)
        blocked = np.zeros(len(origins), bool)
        for part in self._parts:
            rays = np.flatnonzero(~blocked)
            rays, starts = part.rays(origins, directions, rays)
            if len(rays):
                limit = None if distances is None else np.asarray(distances)[rays]
                blocked[rays] = part.caster.occluded(starts, directions[rays], limit)
        return blocked

    def intersect(self, origins, directions):
        """See `RayCaster`."""
        origins, directions = np.asarray(origins), np.asarray(directions)
        n_rays = len(origins)
        nearest = Hits(
            np.full(n_rays, MISS, np.int32),
            np.zeros((n_rays, 2), np.float32),
            np.full(n_rays, np.inf, np.float32),
        )
        for part in self._parts:
            rays, starts = part.rays(origins, directions, np.arange(n_rays))
            if not len(rays):
                continue
            hits = part.caster.intersect(starts, directions[rays])
            nearer = hits.distance < nearest.distance[rays]
            rays, hits = rays[nearer], hits[nearer]
            nearest.triangle[rays] = part.triangles[hits.triangle]
            nearest.barycentric[rays] = hits.barycentric
            nearest.distance[rays] = hits.distance
        return nearest

    def close(self):
        """Free what the casters hold."""
        for part in self._parts:
            part.caster.close()


class _Part:
    """One frame: its caster, its box, and the scene's numbers of its triangles."""

    def __init__(self, centre, triangles, corners, caster):
        self.centre, self.triangles, self.caster = centre, triangles.astype(np.int32), caster
        low, high = corners.min(axis=0).astype(np.float64), corners.max(axis=0).astype(np.float64)
        # A ray along a flat box's face must not miss it by rounding.
        spare = 1e-6 * (np.abs(low) + np.abs(high) + (high - low).max())
        self._low, self._high = low - spare, high + spare

    def rays(self, origins, directions, subset):
        """Those of some rays that meet the box, and where they start in this frame, float32."""
        starts = origins[subset] - self.centre
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / directions[subset].astype(np.float64)
            ends = np.stack([(self._low - starts) * inverse, (self._high - starts) * inverse])
        # 0 / 0: a ray within the face of the box, along it.
        near = np.nan_to_num(ends.min(axis=0), nan=-np.inf).max(axis=1)
        far = np.nan_to_num(ends.max(axis=0), nan=np.inf).min(axis=1)
        meets = (far >= 0) & (near <= far)
        return subset[meets], starts[meets].astype(np.float32)
