"""Which bake points are neighbours on a surface: along lattices of triangles, or in an image."""

import numpy as np

from prt_core.scene.lattice import lattice_coordinates, lattice_index


def field_edges(scene, point):
    """Pairs of neighbours among some bake points.

    Parameters
    ----------
    scene : Scene
    point : (n,) int
        Ascending.

    Returns
    -------
    (m, 2) int64
        Indices into `point`, each pair once.
    """
    pairs = [_along_lattices(scene, lattice) for lattice in (scene.lattice, scene.lattice_back)]
    if scene.image is not None:
        pairs.append(_in_image(scene))
    pairs = np.concatenate(pairs)
    row = np.full(len(scene.points) + 1, -1)
    row[point] = np.arange(len(point))
    # Index -1, which no point has, leads to the last place.
    pairs = row[pairs]
    pairs = pairs[(pairs >= 0).all(axis=1) & (pairs[:, 0] != pairs[:, 1])]
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _along_lattices(scene, lattice):
    pairs = []
    for level in np.unique(scene.triangle_level):
        start = scene.lattice_start[scene.triangle_level == level]
        i, j = lattice_coordinates(int(level)).T
        inner = i + j < level
        i, j = i[inner], j[inner]
        here, down, right = (
            lattice_index(int(level), i + di, j + dj) for di, dj in ((0, 0), (1, 0), (0, 1))
        )
        for one, two in ((here, down), (here, right), (down, right)):
            ends = [lattice[(start[:, None] + end).ravel()] for end in (one, two)]
            pairs.append(np.stack(ends, axis=1))
    return np.concatenate(pairs).astype(np.int64)


def _in_image(scene):
    """Neighbouring texels that face the same side: over a seam of the map they may not."""
    image, normals = scene.image, scene.points.normals
    grid = np.full(image.height * image.width, -1, np.int64)
    grid[image.pixel] = image.point
    grid = grid.reshape(image.height, image.width)
    pairs = np.concatenate(
        [
            np.stack([grid[1:], grid[:-1]], axis=-1).reshape(-1, 2),
            np.stack([grid[:, 1:], grid[:, :-1]], axis=-1).reshape(-1, 2),
        ]
    )
    return pairs[(normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) > 0]
