"""The surfaces of a bake's objects as glTF has them: an array of vertices a material.

A vertex is a bake point and a place of the UV map: colours, normals and materials are those of
points, so that vertices are split where corners differ in one of these, and nowhere else.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.export.glb.placement import Placement
from prt_core.scene.lattice import lattice_index

# How far vertices of instances may lie apart to be one, as a share of the object's size.
_ALIKE = 1e-6


@dataclass(frozen=True)
class Surface:
    """The part of an object that has one material, in the object's own space and glTF's axes.

    Attributes
    ----------
    material : str
        Its name.
    points : (n_vertices,) int64
        The bake point of each vertex.
    positions, normals : (n_vertices, 3) float32
    uv : (n_vertices, 2) float32 or None
        Of glTF: down from the top.
    triangles : (n_triangles, 3) int64
    """

    material: str
    points: np.ndarray
    positions: np.ndarray
    normals: np.ndarray
    uv: np.ndarray | None
    triangles: np.ndarray


class Geometry:
    """The surfaces of the objects of one scene; instances have the arrays of the first of them.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene):
        self._scene = scene
        owner = scene.triangle_object.astype(np.int64)
        self._order = np.argsort(owner, kind="stable")
        self._ends = np.cumsum(np.bincount(owner, minlength=len(scene.objects)))
        self._first_vertex = np.cumsum([0, *(item.n_vertices for item in scene.objects)])
        self._shapes = {}

    def surfaces(self, index):
        """The `Placement` of an object and its `Surface`s, one a material.

        Parameters
        ----------
        index : int
            Of the object in the scene; one without triangles of area has no surfaces.
        """
        item, scene = self._scene.objects[index], self._scene
        first = self._ends[index - 1] if index else 0
        mine = self._order[first : self._ends[index]]
        parts = item.parts
        placement = Placement.of(np.eye(4) if parts is None else parts.matrix)
        if parts is None:
            # Bakes of before know the points of triangles, not their corners.
            vertex = scene.triangles[mine].astype(np.int64) - self._first_vertex[index]
            point, uv = self._lattice_corners(mine), None
            slot = np.zeros(len(mine), np.int64)
        else:
            corners = parts.triangle_corners
            vertex, point = item.corner_vertex[corners], item.corner_point[corners]
            uv = None if parts.corner_uv is None else parts.corner_uv[corners]
            slot = parts.corner_material[corners[:, 0]]
        result = []
        for number in np.unique(slot):
            here = slot == number
            # A mirrored node turns triangles round: first they are as those of its source.
            way = slice(None, None, -1 if placement.mirrored else 1)
            part = (None if x is None else x[here][:, way] for x in (vertex, point, uv))
            name = material_name(item, int(number))
            result.append(self._surface(name, placement, index, *part))
        return placement, result

    def _lattice_corners(self, triangles):
        """(n, 3) int64 points at the corners of triangles, by their lattices."""
        scene = self._scene
        level = scene.triangle_level[triangles].astype(np.int64)
        slots = [lattice_index(level, *place) for place in ((0, 0), (level, 0), (0, level))]
        start = scene.lattice_start[triangles]
        return scene.lattice[np.stack([start + slot for slot in slots], axis=1)].astype(np.int64)

    def _surface(self, name, placement, index, vertex, point, uv):
        key = np.column_stack([point.ravel(), vertex.ravel()])
        if uv is not None:
            # Zero and minus zero are one place.
            bits = (uv.reshape(-1, 2) + np.float32(0)).view(np.int32)
            key = np.column_stack([key, bits])
        first, of_corner = _distinct(key)
        triangles = of_corner.reshape(-1, 3)
        points = point.ravel()[first].astype(np.int64)
        scene = self._scene
        place = scene.vertices[self._first_vertex[index] + vertex.ravel()[first]]
        positions = placement.local(scene.to_world(place)).astype(np.float32)
        normals = placement.local_normals(scene.points.normals[points].astype(np.float64))
        normals = normals.astype(np.float32)
        if uv is not None:
            uv = uv.reshape(-1, 2)[first] * np.float32([1, -1]) + np.float32([0, 1])
        positions, normals = self._shared(positions, normals, triangles, uv)
        return Surface(name, points, positions, normals, uv, triangles)

    def _shared(self, positions, normals, triangles, uv):
        """Positions and normals of an instance that was there before, where these are they."""
        key = len(positions), triangles.tobytes(), b"" if uv is None else uv.tobytes()
        known = self._shapes.setdefault(key, [])
        size = float(np.ptp(positions, axis=0).max())
        for place, normal in known:
            near = np.abs(place - positions).max() <= _ALIKE * size
            if near and np.abs(normal - normals).max() <= 1e-3:
                return place, normal
        known.append((positions, normals))
        return positions, normals


def material_name(item, number):
    """Name of a material of an object by its number; that of the object where it has none."""
    names = () if item.parts is None else item.parts.material_names
    return (names and number >= 0 and names[min(number, len(names) - 1)]) or item.name


def _distinct(key):
    """Distinct rows in the order in which they first come.

    Parameters
    ----------
    key : (n, k) int

    Returns
    -------
    first : (m,) int64
        Where each comes first.
    number : (n,) int64
        Which of them each row is.
    """
    order = np.lexsort(key.T[::-1])
    new = np.ones(len(order), bool)
    new[1:] = (np.diff(key[order].astype(np.int64), axis=0) != 0).any(axis=1)
    starts = np.flatnonzero(new)
    # Sorting is stable: the first of equal rows is the one that comes first.
    first = order[starts]
    place = np.argsort(np.argsort(first))
    number = np.empty(len(order), np.int64)
    number[order] = place[np.cumsum(new) - 1]
    return np.sort(first), number
