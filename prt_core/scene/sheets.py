"""Which surfaces are sheets, that are looked at from both sides: those with long open borders."""

import numpy as np

# Of a surface of one square unit: a square has 4, a sphere with a pin-hole next to none.
_LONG = 1.0


def is_sheet(mesh):
    """Whether a mesh is open for more than holes in something closed.

    Parameters
    ----------
    mesh : Mesh

    Returns
    -------
    bool
        Whether its open edges are longer than the square root of its area.
    """
    corners = mesh.solid_triangles()
    if not len(corners):
        return False
    # Vertices in one place are one: seams of an unwrapped mesh are no borders.
    _, same = np.unique(mesh.vertices, axis=0, return_inverse=True)
    places = same.reshape(-1)[mesh.corner_vertex[corners]]
    edges = np.sort(np.stack([places, np.roll(places, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, first, count = np.unique(edges, axis=0, return_index=True, return_counts=True)
    ends = mesh.vertices[mesh.corner_vertex[corners]]
    length = np.linalg.norm(np.roll(ends, -1, axis=1) - ends, axis=2).ravel()[first]
    doubled = np.linalg.norm(np.cross(ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0]), axis=1)
    return bool(length[count == 1].sum() > _LONG * np.sqrt(doubled.sum() / 2))
