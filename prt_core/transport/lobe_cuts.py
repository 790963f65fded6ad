"""Where lobes are evaluated: finely around the mirror direction, by ever larger blocks beyond.

A lobe falls off around the mirror direction at a rate that goes with the distance, so blocks may
grow with it (as the cuts of Walter et al. 2005 do through trees of lights). Closest by, blocks of
the field of incoming light are cut into parts. Points whose mirror directions fall into one cell
share a cut.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from prt_core.sphere import CubeMap
from prt_core.transport.field_nodes import field_nodes

# Width of a block in parts of the distance from the mirror direction, or of the lobe's own width;
# and that beyond which the smallest blocks are cut into parts.
_WIDTH, _OF_SMALLEST = 0.4, 0.5
_MOST_PARTS = 4
# Points for each cell of a face, about.
_SHARING = 250


@dataclass(frozen=True)
class LobeCut:
    """What the lobes of some points are evaluated at.

    Attributes
    ----------
    core : (k,) int
        Blocks that are cut into parts.
    parts : int
        Along an edge of each of them.
    nodes : (m,) int
        Whole blocks, of `FieldNodes`.
    """

    core: np.ndarray
    parts: int
    nodes: np.ndarray


def parts_along(side, width, resolution):
    """Parts along the edge of a block, for lobes of a width: a power of two, 1 to 4.

    They may be smaller than the `resolution` texels of the light, for a lobe that is seen at a
    slant is narrow even where the light is not; but neither may cut the other.
    """
    size, parts = np.pi / 2 / side, 1
    while size / parts > _OF_SMALLEST * width and parts < _MOST_PARTS:
        finer = 2 * side * parts
        if resolution % finer and finer % resolution:
            break
        parts *= 2
    return parts


def cells(side, n_points):
    """Along an edge of a cube map, the cells of mirror directions that share a cut.

    Larger ones for few points, as each takes time of its own; their cuts have more blocks.
    """
    most = max(min(side, 4 + side // 4), 1)
    return int(np.clip(np.sqrt(n_points / _SHARING), min(3, most), most))


@lru_cache(maxsize=8192)
def lobe_cut(side, around, cell, width, parts):
    """The `LobeCut` of mirror directions within a cell.

    Parameters
    ----------
    side : int
        Of the smallest blocks, along an edge of a face.
    around, cell : int
        Of so many cells along an edge (see `cells`).
    width : float
        Of the narrowest lobe, in radians.
    parts : int
        See `parts_along`.
    """
    tree = field_nodes(side)
    centre, radius = _cube_map(around).directions[cell], np.pi / 4 / around * 1.35
    nodes, last = [], len(tree.sides) - 1
    here = np.arange(6 * tree.sides[last] ** 2)
    for level in range(last, -1, -1):
        n = tree.sides[level]
        blocks = _cube_map(n)
        away = np.arccos(np.clip(blocks.directions[here] @ centre, -1, 1))
        away = np.maximum(away - radius, 0)
        most = (_WIDTH if level else _OF_SMALLEST) * np.hypot(width, away)
        large = np.sqrt(blocks.solid_angles[here]) > most
        large &= level > 0 or parts > 1
        nodes.append(tree.first[level] + here[~large])
        here = here[large]
        if level:
            here = _quarters(here, n)
    return LobeCut(here, parts, np.concatenate(nodes))


@lru_cache(maxsize=16)
def _cube_map(side):
    return CubeMap(side)


def _quarters(blocks, side):
    """The blocks half as wide within some blocks, of `side` along an edge."""
    face, place = np.divmod(blocks, side * side)
    row, column = np.divmod(place, side)
    row, column = 2 * row[:, None] + [0, 0, 1, 1], 2 * column[:, None] + [0, 1, 0, 1]
    return np.sort(((face[:, None] * 2 * side + row) * 2 * side + column).ravel())


@lru_cache(maxsize=16)
def pieces(side, parts):
    """(parts^2, n_blocks): the texels of a cube map `parts` times as fine in each block."""
    order = np.arange(6 * (side * parts) ** 2).reshape(6, side, parts, side, parts)
    return np.ascontiguousarray(order.swapaxes(2, 3).reshape(-1, parts * parts).T)


def detail_of(light, cube_map, side, parts):
    """What the light of parts of blocks has more than that of the blocks.

    Parameters
    ----------
    light : (n_directions, 3) float
    cube_map : CubeMap
        Of the light.
    side, parts : int

    Returns
    -------
    (parts^2, n_blocks, 3) float32
        As `pieces` has them.
    """
    whole, fine = (_means(light, cube_map, n) for n in (side, side * parts))
    return (fine[pieces(side, parts)] - whole).astype(np.float32)


def _means(light, cube_map, side):
    """(6 side^2, 3) means over blocks, by solid angle; blocks within a texel have its value."""
    n = cube_map.resolution
    if side > n:
        faces, times = light.reshape(6, n, n, -1), side // n
        return faces.repeat(times, axis=1).repeat(times, axis=2).reshape(6 * side**2, -1)
    step = n // side
    angles = cube_map.solid_angles[:, None]

    def sums(values):
        parts = values.reshape(6, side, step, side, step, -1)
        return parts.sum(axis=(2, 4)).reshape(6 * side**2, -1)

    return sums(light * angles) / sums(angles)
