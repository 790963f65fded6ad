"""Tangent frames that turn as little as they can along a surface.

HRDFs of neighbours are alike only where their frames are: along the lines of a UV map where there
is one, else along one axis of the world, evened out over neighbours on the mesh, by the connection
that carries tangents from one to the other (Knoppel et al. 2013). A closed surface without holes
has no field without singularities; at these a frame is that of `tangent_frames`.
"""

import numpy as np
from scipy.sparse import coo_array

from prt_core.errors import expect, expect_array, expect_numbers
from prt_core.sphere import tangent_frames

# Times that each point takes the mean of its own direction and its neighbours'.
_EVENED = 64
# Of what would be without cancellation: below it there is no direction.
_NONE = 1e-4
_FAR = 1e12


def frames_along(normals, tangents):
    """Frames whose first tangent is as near as can be to a direction.

    Parameters
    ----------
    normals : (n, 3) float
        Unit vectors.
    tangents : (n, 3) float
        Of any length; where one is 0 or along the normal, the frame is that of `tangent_frames`.

    Returns
    -------
    (n, 3, 3) float32
        Rows: tangent, bitangent, normal; right-handed.
    """
    normals = _unit("normals", normals)
    tangents = expect_array("tangents", tangents, normals.shape, np.float64, -_FAR, _FAR)
    flat = tangents - (tangents * normals).sum(axis=1, keepdims=True) * normals
    lengths = np.linalg.norm(flat, axis=1)
    good = lengths > _NONE * np.maximum(np.linalg.norm(tangents, axis=1), 1e-30)
    frames = tangent_frames(normals)
    frames[good, 0] = flat[good] / lengths[good, None]
    frames[:, 1] = np.cross(normals, frames[:, 0])
    return frames.astype(np.float32)


def uv_tangents(positions, triangles, uv):
    """The direction in which u rises on each triangle.

    Parameters
    ----------
    positions : (n, 3) float
    triangles : (m, 3) int
    uv : (n, 2) or (m, 3, 2) float
        Of points, or of the corners of triangles.

    Returns
    -------
    (m, 3) float64
        Along the triangle, as long as twice its area; 0 where u does not rise or UV has no area.
    """
    positions = expect_array("positions", positions, (None, 3), np.float64, -_FAR, _FAR)
    triangles = expect_array("triangles", triangles, (None, 3), np.int64, 0, len(positions) - 1)
    uv = expect_numbers("uv", uv)
    if uv.ndim == 2:
        uv = expect_array("uv", uv, (len(positions), 2), np.float64, -_FAR, _FAR)[triangles]
    uv = expect_array("uv", uv, (len(triangles), 3, 2), np.float64, -_FAR, _FAR)
    first, second = (positions[triangles[:, k]] - positions[triangles[:, 0]] for k in (1, 2))
    along, across = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    turned = np.sign(along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0])
    rising = turned[:, None] * (first * across[:, 1:] - second * along[:, 1:])
    lengths = np.linalg.norm(rising, axis=1)
    areas = np.linalg.norm(np.cross(first, second), axis=1)
    return rising * (areas / np.where(lengths > 0, lengths, 1))[:, None]


def frames_along_uv(positions, normals, triangles, uv):
    """Frames of a mesh's points along the lines of its UV map.

    Parameters
    ----------
    positions, normals : (n, 3) float
    triangles : (m, 3) int
    uv : (n, 2) or (m, 3, 2) float
        Of points, or of the corners of triangles.

    Returns
    -------
    (n, 3, 3) float32
        Those of `tangent_frames` where the triangles around a point do not agree, as at a pole.
    """
    normals = _unit("normals", normals)
    rising = uv_tangents(positions, triangles, uv)
    triangles = np.asarray(triangles, np.int64)
    expect(
        len(positions) == len(normals),
        f"normals: expected one for each of {len(positions)} positions, got {len(normals)}",
    )
    sums, lengths = np.zeros(normals.shape), np.zeros(len(normals))
    for corner in triangles.T:
        np.add.at(sums, corner, rising)
        np.add.at(lengths, corner, np.linalg.norm(rising, axis=1))
    sums[np.linalg.norm(sums, axis=1) <= 1e-2 * lengths] = 0
    return frames_along(normals, sums)


def smooth_frames(normals, edges):
    """Frames of a mesh's points along one axis, evened out over neighbours.

    Parameters
    ----------
    normals : (n, 3) float
        Unit vectors.
    edges : (m, 2) int
        Pairs of points that are neighbours on the surface.

    Returns
    -------
    (n, 3, 3) float32
        Points without neighbours, and singular ones, have those of `tangent_frames`.
    """
    normals = _unit("normals", normals)
    n = len(normals)
    edges = expect_array("edges", edges, (None, 2), np.int64, 0, n - 1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    frames = tangent_frames(normals)
    if not len(edges):
        return frames.astype(np.float32)
    # In the frame of a point a tangent is a complex number; along an edge it turns by an angle.
    angles = _turning(frames, *edges.T)
    both = np.concatenate([edges, edges[:, ::-1]])
    turns = np.exp(1j * np.concatenate([angles, -angles]))
    degrees = np.bincount(both[:, 0], minlength=n).astype(np.float64)
    means = coo_array((turns / degrees[both[:, 1]], (both[:, 1], both[:, 0])), shape=(n, n)).tocsr()
    # The axis that is flattest on the surface, as a whole.
    axis = np.linalg.eigh(normals.T @ normals)[1][:, 0]
    field = frames[:, 0] @ axis + 1j * (frames[:, 1] @ axis)
    for _ in range(_EVENED):
        # With its own share, or points of a grid would swap theirs for ever.
        field = (field + means @ field) / 2
    tangents = field.real[:, None] * frames[:, 0] + field.imag[:, None] * frames[:, 1]
    tangents[(np.abs(field) < _NONE) | (degrees == 0)] = 0
    return frames_along(normals, tangents)


def _turning(frames, start, end):
    """The angle by which the tangent of `start` is turned against that of `end`, carried there."""
    tangent, normal = frames[start, 0], frames[start, 2]
    target = frames[end, 2]
    # The rotation that takes one normal to the other and turns about nothing else.
    axis = np.cross(normal, target)
    cosine = (normal * target).sum(axis=1, keepdims=True)
    along = (axis * tangent).sum(axis=1, keepdims=True)
    # Opposite normals, as on a fold, have no such rotation: any will do.
    carried = (
        cosine * tangent + np.cross(axis, tangent) + axis * along / np.maximum(1 + cosine, 1e-9)
    )
    x = (carried * frames[end, 0]).sum(axis=1)
    return np.arctan2((carried * frames[end, 1]).sum(axis=1), x)


def _unit(name, vectors):
    vectors = expect_array(name, vectors, (None, 3), np.float64, -1.001, 1.001)
    lengths = np.linalg.norm(vectors, axis=1)
    expect(
        not len(lengths) or np.abs(lengths - 1).max() < 1e-3,
        f"{name}: expected unit vectors, got lengths from {lengths.min(initial=1):.3g} "
        f"to {lengths.max(initial=0):.3g}",
    )
    return vectors
