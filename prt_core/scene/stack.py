"""The meshes of a scene, one after the other in arrays, and the frame that they lie in."""

from dataclasses import dataclass

import numpy as np

# Triangles gone through at once where all are.
_TRIANGLES = 1 << 16
# Corners of meshes that are made into points together.
_CORNERS = 1 << 18


@dataclass
class Stack:
    """What of all meshes is needed at once; all else is read from them, some meshes at a time.

    Attributes
    ----------
    vertices : (n_vertices, 3) float64
    triangles : (n_triangles, 3) int32
        Those that have an area, by vertices.
    corners : (n_triangles, 3) int32
        By corners, as their own mesh counts them.
    triangle_object : (n_triangles,) int32
    receives, flat, two_sided : (n_meshes,) bool
    first_vertex, first_corner, first_triangle : (n_meshes + 1,) int64
        Where each mesh begins, and where the last one ends.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    corners: np.ndarray
    triangle_object: np.ndarray
    receives: np.ndarray
    flat: np.ndarray
    two_sided: np.ndarray
    first_vertex: np.ndarray
    first_corner: np.ndarray
    first_triangle: np.ndarray

    def batches(self, most=None):
        """Slices of meshes that follow each other, of about so many corners together at most."""
        most, first, n_meshes = most or _CORNERS, 0, len(self.receives)
        while first < n_meshes:
            ends = np.searchsorted(self.first_corner, self.first_corner[first] + most, side="right")
            end = min(max(int(ends) - 1, first + 1), n_meshes)
            yield slice(first, end)
            first = end

    def parts(self):
        """Slices of triangles that are gone through at once."""
        return parts_of_triangles(len(self.triangles))

    def move_to_frame(self):
        """Move vertices to the frame of what is seen; returns its centre (3,) and its size."""
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for part in self.parts():
            positions = self.vertices[self.triangles[part]].reshape(-1, 3)
            low = np.minimum(low, positions.min(axis=0))
            high = np.maximum(high, positions.max(axis=0))
        # The longest side of the box around it.
        centre, size = (low + high) / 2, float((high - low).max())
        self.vertices -= centre
        self.vertices /= size
        return centre, size


def stack_meshes(meshes, messages):
    """All meshes as one `Stack`; triangles without area are dropped and counted.

    Parameters
    ----------
    meshes : sequence of Mesh
    messages : list of str
        Told what was dropped.
    """
    first_vertex = _starts([len(mesh.vertices) for mesh in meshes])
    first_corner = _starts([len(mesh.corner_vertex) for mesh in meshes])
    vertices = np.empty((first_vertex[-1], 3))
    triangles, corners = [], []
    for mesh, first in zip(meshes, first_vertex, strict=False):
        vertices[first : first + len(mesh.vertices)] = mesh.vertices
        solid = mesh.solid_triangles()
        ignored = len(mesh.triangle_corners) - len(solid)
        if ignored:
            messages.append(f"{mesh.name}: {ignored} triangles without area ignored")
        triangles.append((mesh.corner_vertex[solid] + first).astype(np.int32))
        corners.append(solid.astype(np.int32))
    counts = [len(each) for each in triangles]
    none = [np.zeros((0, 3), np.int32)]
    return Stack(
        vertices,
        np.concatenate(triangles or none),
        np.concatenate(corners or none),
        np.repeat(np.arange(len(meshes), dtype=np.int32), counts),
        *(
            np.array([getattr(mesh, flag) for mesh in meshes], bool)
            for flag in ("receives", "flat", "two_sided")
        ),
        first_vertex,
        first_corner,
        _starts(counts),
    )


def parts_of_triangles(count):
    """Slices of so many triangles that are gone through at once."""
    for first in range(0, count, _TRIANGLES):
        yield slice(first, first + _TRIANGLES)


def _starts(counts):
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
