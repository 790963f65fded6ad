"""A mesh as one closed surface: the same places are the same vertex, and holes are filled.

What a parametrisation over the sphere needs to begin with. Everything is told by half-edges: each
triangle has three, and a surface is where each of them meets one that runs the other way.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from prt_core.errors import expect

# Places nearer than this, in units of the mesh's size, are one: float32 coordinates lie as far off.
_SAME = 1e-6
# A coarser mesh is cut finer: large triangles cannot be laid evenly over a sphere.
_FEWEST_FACES = 2000
# Shares of the surface that may belong to other parts, or to what fills holes.
_MOST_OTHER, _MOST_FILLED = 0.1, 0.25


@dataclass(frozen=True)
class ClosedSurface:
    """A triangulated sphere.

    Attributes
    ----------
    vertices : (n_vertices, 3) float64
        Relative to the mesh's centre, in units of its size.
    faces : (n_faces, 3) int64
    source : (n_faces,) int64
        The triangle each face was, or is a part of; -1 for those that fill a hole.
    places : (n_faces, 3, 2) float64
        Where the corners of a face lie in that triangle: weights of its second and third corner.
    of_vertex : (n,) int64
        A vertex for each of those it was made from, -1 where there is none.
    n_holes : int
    filled, other : float
        Shares of the surface: what fills holes, and what was left out with other parts.
    """

    vertices: np.ndarray
    faces: np.ndarray
    source: np.ndarray
    places: np.ndarray
    of_vertex: np.ndarray
    n_holes: int
    filled: float
    other: float


def closed_surface(name, vertices, triangles):
    """The largest part of a mesh, closed.

    Holes get a vertex in their middle; vertices where two sheets touch become two. Small parts
    (a tenth of the surface in all: eyes, buttons) are left out.

    Parameters
    ----------
    name : str
        What errors call it.
    vertices : (n, 3) float64
    triangles : (m, 3) int

    Returns
    -------
    ClosedSurface

    Raises
    ------
    PRTError
        It is not a sphere with small holes: an edge has more than two faces, or two that face
        different ways; there are handles; it is an open sheet, for which half of a sphere would
        show nothing; or several large parts.
    """
    used = np.unique(triangles)
    _expect(len(used), name, "it has no triangle with an area")
    low, high = vertices[used].min(axis=0), vertices[used].max(axis=0)
    places = (vertices - (low + high) / 2) / ((high - low).max() or 1.0)
    welded = np.full(len(vertices), -1)
    welded[used] = _weld(places[used])
    corners = welded[triangles]
    source = np.flatnonzero((corners != np.roll(corners, 1, axis=1)).all(axis=1))
    mine, other = _largest_part(name, corners[source], triangle_areas(places[triangles[source]]))
    source = source[mine]

    faces = _split_vertices(corners[source])
    own = np.empty((int(faces.max()) + 1, 3))
    own[faces] = places[triangles[source]]
    of_welded = np.full(len(vertices), -1)
    of_welded[corners[source]] = faces
    of_vertex = np.where(welded < 0, -1, of_welded[welded])
    of_vertex[triangles[source]] = faces

    own, caps, n_holes = _caps(own, faces)
    faces = np.concatenate([faces, caps])
    source = np.concatenate([source, np.full(len(caps), -1)])
    handles = 1 - (len(own) - len(faces) // 2) // 2
    _expect(handles == 0, name, f"it has {handles:,} handles (and {n_holes:,} holes)")
    _expect(len(own) > 3, name, "it has fewer than four corners")
    areas = triangle_areas(own[faces])
    filled = areas[source < 0].sum() / areas.sum()
    _expect(
        filled <= _MOST_FILLED,
        name,
        f"it is an open sheet: what would fill its {n_holes:,} holes is {filled:.0%} of the "
        "surface",
    )
    parts = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (len(faces), 1, 1))
    while len(faces) < _FEWEST_FACES:
        own, faces, parts = _halved(own, faces, parts)
        source = np.tile(source, 4)
    return ClosedSurface(own, faces, source, parts, of_vertex, n_holes, float(filled), float(other))


def _expect(condition, name, count):
    expect(
        condition,
        f"{name}: a geometry image over the sphere needs a closed surface without handles, but "
        f"{count}; or unwrap the object and use its UV map",
    )


def _largest_part(name, faces, areas):
    """Which faces are of it, and the share of the surface that is of others."""
    twin, n_wrong = _twins(faces)
    _expect(
        not n_wrong,
        name,
        f"{n_wrong:,} edges have more than two faces, or two that face different ways; mend the "
        "mesh (merge by distance, recalculate normals)",
    )
    met = np.flatnonzero(twin >= 0)
    part, n_parts = _joined(len(faces), met // 3, twin[met] // 3)
    part_areas = np.bincount(part, areas, n_parts)
    other = 1 - part_areas.max() / part_areas.sum()
    _expect(
        other <= _MOST_OTHER,
        name,
        f"its {n_parts:,} parts are not joined, and the largest is {1 - other:.0%} of it; separate "
        "them",
    )
    return part == part_areas.argmax(), other


def _weld(places):
    """(n,) int: the first of those at the same place."""
    pairs = cKDTree(places).query_pairs(_SAME, output_type="ndarray")
    n = len(places)
    graph = sp.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n))
    return connected_components(graph, directed=False)[1]


def _twins(faces):
    """For half-edge 3 f + k, from corner k of face f to the next, its twin or -1.

    Also how many half-edges run the same way along the same edge as another.
    """
    start, stop = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    n = int(faces.max(initial=0)) + 1
    key, wanted = start * n + stop, stop * n + start
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    place = np.minimum(np.searchsorted(ordered, wanted), len(key) - 1)
    twin = np.where(ordered[place] == wanted, order[place], -1)
    return twin, int((np.diff(ordered) == 0).sum())


def _joined(n, first, second):
    graph = sp.coo_matrix((np.ones(len(first)), (first, second)), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    return label.astype(np.int64), count


def _split_vertices(faces):
    """Faces whose vertices are fans of faces: corners that meet along an edge are one vertex."""
    twin, _ = _twins(faces)
    met = np.flatnonzero(twin >= 0)
    after = met // 3 * 3 + (met + 1) % 3
    other = twin[met]
    other_after = other // 3 * 3 + (other + 1) % 3
    first, second = np.concatenate([met, after]), np.concatenate([other_after, other])
    return _joined(faces.size, first, second)[0].reshape(-1, 3)


def _caps(vertices, faces):
    """Vertices with one in the middle of each hole, the faces from it to the edge, the holes."""
    twin, _ = _twins(faces)
    edge = np.flatnonzero(twin < 0)
    start, stop = faces.ravel()[edge], np.roll(faces, -1, axis=1).ravel()[edge]
    # Each vertex is a single fan, so that it is on the edge of one hole at most, once.
    hole, _ = _joined(len(vertices), start, stop)
    _, hole = np.unique(hole[start], return_inverse=True)
    count = int(hole.max(initial=-1)) + 1
    sizes = np.maximum(np.bincount(hole, minlength=count), 1)[:, None]
    middles = [np.bincount(hole, vertices[start, axis], count) for axis in range(3)]
    caps = np.column_stack([stop, start, len(vertices) + hole])
    return np.concatenate([vertices, np.stack(middles, axis=1) / sizes]), caps, count


def _halved(vertices, faces, parts):
    """Each edge cut in half, and each face in four; `parts` are values at its corners."""
    start, stop = faces, np.roll(faces, -1, axis=1)
    n = len(vertices)
    key, index = np.unique(
        np.minimum(start, stop) * n + np.maximum(start, stop), return_inverse=True
    )
    middle = n + index.reshape(-1, 3)
    vertices = np.concatenate([vertices, (vertices[key // n] + vertices[key % n]) / 2])
    between = (parts + np.roll(parts, -1, axis=1)) / 2
    faces = [(faces[:, k], middle[:, k], middle[:, k - 1]) for k in range(3)]
    parts = [(parts[:, k], between[:, k], between[:, k - 1]) for k in range(3)]
    faces.append(middle.T)
    parts.append(between.transpose(1, 0, 2))
    return (
        vertices,
        np.concatenate([np.stack(face, axis=1) for face in faces]),
        np.concatenate([np.stack(part, axis=1) for part in parts]),
    )


def triangle_areas(corners):
    """(m,) float64 of (m, 3, 3) corners."""
    a, b, c = np.moveaxis(corners, 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
