"""The protocol every ray caster follows, and the table of back-ends."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from prt_core.errors import PRTError, expect, expect_array, expect_kind, expect_numbers, shown

MISS = -1
_FACTORIES = {}


@dataclass(frozen=True)
class Hits:
    """Closest hits of m rays.

    Attributes
    ----------
    triangle : (m,) int32
        -1 where nothing was hit.
    barycentric : (m, 2) float32
        Weights of the triangle's second and third corner; 0 on a miss.
    distance : (m,) float32
        Infinity on a miss.
    """

    triangle: np.ndarray
    barycentric: np.ndarray
    distance: np.ndarray

    @classmethod
    def joined(cls, parts):
        """Those of several calls, `parts`, one after the other."""
        arrays = ((part.triangle, part.barycentric, part.distance) for part in parts)
        return cls(*map(np.concatenate, zip(*arrays, strict=True)))

    def __getitem__(self, rays):
        """Those of some rays."""
        return Hits(self.triangle[rays], self.barycentric[rays], self.distance[rays])


class RayCaster(Protocol):
    """Answers batches of rays; offsets are the caller's business (`Scene.ray_origins`).

    Attributes
    ----------
    name : str
        Written into the report of a bake.
    batch : int
        Rays a call is best given; more is cut by the caller, to stay cancellable.
    threads : int
        How many threads may call it at once; 1 where the back-end spreads the work itself.
    """

    name: str
    batch: int
    threads: int

    def occluded(self, origins, directions, distances=None):
        """(m,) bool: whether anything is hit, up to `distances` (m,) where given.

        `origins` (m, 3) float32; `directions` (m, 3) float32, unit length.
        """

    def intersect(self, origins, directions) -> Hits:
        """The closest hit of each ray, from `origins` along `directions` (m, 3) float32."""

    def close(self):
        """Free what the caster holds; it cannot be used afterwards."""


def as_rays(origins, directions):
    """`origins` and `directions` as (m, 3) float32, contiguous and finite."""
    origins = expect_array("origins", origins, (None, 3), np.float32)
    directions = expect_array("directions", directions, (len(origins), 3), np.float32)
    return np.ascontiguousarray(origins), np.ascontiguousarray(directions)


def as_limits(distances, n_rays):
    """How far rays go, (n_rays,) float32, or None: as far as they will."""
    if distances is None:
        return None
    array = expect_numbers("distances", distances)
    good = array.shape == (n_rays,) and not np.isnan(array).any()
    expect(good, f"distances: expected {n_rays} numbers, got {shown(distances)}")
    with np.errstate(over="ignore"):
        return np.asarray(array, np.float32)


def barycentric_of(vertices, triangles, origins, directions, triangle):
    """Barycentric weights and distances of known hits, float64 inside (Möller & Trumbore 1997).

    Parameters
    ----------
    vertices : (n_vertices, 3) float
    triangles : (n_triangles, 3) int
    origins, directions : (m, 3)
    triangle : (m,) int
        The triangle each ray hits; -1 is a miss.
    """
    barycentric = np.zeros((len(triangle), 2), np.float32)
    distance = np.full(len(triangle), np.inf, np.float32)
    hit = np.flatnonzero(triangle >= 0)
    if len(hit):
        corners = triangles.take(triangle.take(hit), axis=0)
        # One array a coordinate: a third of the time that rows of three take.
        a, b, c = (vertices.take(corners[:, k], axis=0).T.astype(np.float64) for k in range(3))
        direction = directions.take(hit, axis=0).T.astype(np.float64)
        edge1, edge2, start = b - a, c - a, origins.take(hit, axis=0).T - a
        p = _cross(direction, edge2)
        determinant = _dot(edge1, p)
        scale = 1 / np.where(np.abs(determinant) > 1e-300, determinant, np.inf)
        q = _cross(start, edge1)
        barycentric[hit, 0] = np.clip(_dot(start, p) * scale, 0, 1)
        barycentric[hit, 1] = np.clip(_dot(direction, q) * scale, 0, 1)
        distance[hit] = _dot(edge2, q) * scale
    return barycentric, distance


def _cross(a, b):
    """Cross products of (3, m) arrays."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def register_caster(name, factory):
    """Make a back-end known by `name`: `factory(vertices, triangles) -> RayCaster`."""
    _FACTORIES[name] = factory


def make_caster(name, vertices, triangles):
    """A ray caster over triangles, by name.

    Parameters
    ----------
    name : str
        `blender`, `bvhtree`, `embree`, `brute` or `auto`: Embree where it is installed, else
        Blender's BVH where bpy is there.
    vertices : (n_vertices, 3) float32
    triangles : (n_triangles, 3) int32

    Returns
    -------
    RayCaster

    Raises
    ------
    PRTError
        The back-end is unknown or not installed; nothing falls back in silence.
    """
    expect_kind("caster", name, str, "the name of one")
    vertices = expect_array("vertices", vertices, (None, 3), np.float32)
    triangles = expect_array("triangles", triangles, (None, 3), np.int32, 0, len(vertices) - 1)
    if name == "auto":
        name = next((n for n in ("embree", "blender") if n in _FACTORIES), None)
        if name is None:
            raise PRTError(
                "caster: 'auto' found neither Embree nor Blender; "
                "pip install 'prt-core[embree]' or run inside Blender"
            )
    if name not in _FACTORIES:
        known = {"embree": "pip install embreex", "blender": "pip install bpy or run in Blender"}
        known["bvhtree"] = known["blender"]
        hint = known.get(name, f"choose one of {', '.join(sorted(_FACTORIES))}, auto")
        raise PRTError(f"caster: '{name}' is not available here; {hint}")
    return _FACTORIES[name](vertices, triangles)


def known_casters():
    """Names of the back-ends that can be made here and now."""
    return sorted(_FACTORIES)
