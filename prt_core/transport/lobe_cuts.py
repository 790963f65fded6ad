"""Where lobes are evaluated: finely around the mirror direction, by whole blocks beyond.

A lobe of some width has most of its weight around the mirror direction, so that is where blocks
of the field of incoming light are cut into parts; around those come whole blocks, and what is far
away is taken together, blocks of a coarser field. Points whose mirror directions fall into one
cell share a cut, so that light which is the same for all of them is a product of matrices.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from prt_core.sphere import CubeMap

# Tangents of the angle between normal and facet, in alphas: within the first blocks are cut into
# parts, beyond the second the coarser field is good enough. A share 1 / (1 + t^2) lies beyond t.
_CORE, _RING = 1.0, 3.5
# A part is at most this many alphas wide.
_WIDTH = 0.75
# Blocks along an edge of the coarser field, in parts of the finer one.
COARSER = 4
_MOST_PARTS = 4


@dataclass(frozen=True)
class LobeCut:
    """Directions at which the lobes of some points are evaluated.

    Attributes
    ----------
    directions : (3, m) float32
        Unit vectors: the first part of every block that is cut, the second, and so on; then whole
        blocks, then coarser ones.
    solid_angles : (m,) float32
    n_parts : int
        Parts of each block that is cut.
    core, ring, far : (k,) int
        Blocks that are cut, whole blocks, and blocks of the coarser field.
    """

    directions: np.ndarray
    solid_angles: np.ndarray
    n_parts: int
    core: np.ndarray
    ring: np.ndarray
    far: np.ndarray

    def above(self, normals):
        """What of it is above the horizon of any of some points, by whole blocks.

        Parameters
        ----------
        normals : (k, 3) float32

        Returns
        -------
        LobeCut
        """
        there = (normals @ self.directions > 0).any(axis=0)
        n_core, n_near = self.n_core, self.n_core + len(self.ring)
        core = there[:n_core].reshape(self.n_parts, -1).any(axis=0)
        ring, far = there[n_core:n_near], there[n_near:]
        kept = np.concatenate([np.tile(core, self.n_parts), ring, far])
        return LobeCut(
            np.ascontiguousarray(self.directions[:, kept]),
            self.solid_angles[kept],
            self.n_parts,
            self.core[core],
            self.ring[ring],
            self.far[far],
        )

    @property
    def n_core(self):
        """Directions of the parts of blocks."""
        return len(self.core) * self.n_parts


def parts_along(side, alpha, resolution):
    """Parts along the edge of a block, for lobes of an alpha: a power of two, 1 to 4."""
    width, parts = np.pi / 2 / side, 1
    while width / parts > _WIDTH * alpha and parts < _MOST_PARTS:
        if resolution % (2 * side * parts):
            break
        parts *= 2
    return parts


def cells(side):
    """`CubeMap` whose texels are the cells of mirror directions that share a cut."""
    return CubeMap(max(side // 2, 1))


@lru_cache(maxsize=4096)
def lobe_cut(side, cell, alpha, parts):
    """The `LobeCut` of mirror directions within a cell.

    Parameters
    ----------
    side : int
        Blocks along an edge of the field.
    cell : int
        Of `cells(side)`.
    alpha : float
        Of the widest lobe.
    parts : int
        See `parts_along`.
    """
    fine, around = CubeMap(side), cells(side)
    centre, radius = around.directions[cell], np.pi / 4 / around.resolution * np.sqrt(2)
    away = np.arccos(np.clip(fine.directions @ centre, -1, 1))
    near, wide = (2 * np.arctan(t * alpha) + radius for t in (_CORE, _RING))
    is_core = away < near
    is_ring = ~is_core & (away < wide)
    coarse_side = max(side // COARSER, 1)
    step = side // coarse_side
    owner = np.arange(len(away)).reshape(6, coarse_side, step, coarse_side, step)
    owner = owner.swapaxes(2, 3).reshape(-1, step * step)
    # A coarser block is whole, or its finer ones are.
    touched = (is_core | is_ring)[owner].any(axis=1)
    is_ring[owner[touched]] |= ~is_core[owner[touched]]
    core, ring, far = np.flatnonzero(is_core), np.flatnonzero(is_ring), np.flatnonzero(~touched)
    within = CubeMap(side * parts)
    pieces = _pieces(side, parts)[core].T.ravel()
    coarse = CubeMap(coarse_side)
    directions = np.concatenate(
        [within.directions[pieces], fine.directions[ring], coarse.directions[far]]
    )
    angles = np.concatenate(
        [within.solid_angles[pieces], fine.solid_angles[ring], coarse.solid_angles[far]]
    )
    return LobeCut(
        np.ascontiguousarray(directions.T, np.float32),
        angles.astype(np.float32),
        parts * parts,
        core,
        ring,
        far,
    )


@lru_cache(maxsize=16)
def _pieces(side, parts):
    """(n_blocks, parts^2): the texels of a cube map `parts` times as fine in each block."""
    order = np.arange(6 * (side * parts) ** 2).reshape(6, side, parts, side, parts)
    return order.swapaxes(2, 3).reshape(-1, parts * parts)


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
        Part by part as a `LobeCut` has them.
    """
    whole, fine = (_means(light, cube_map, n) for n in (side, side * parts))
    return (fine[_pieces(side, parts).T] - whole).astype(np.float32)


def _means(light, cube_map, side):
    """(6 side^2, 3) means over blocks, by solid angle."""
    step = cube_map.resolution // side
    angles = cube_map.solid_angles[:, None]

    def sums(values):
        parts = values.reshape(6, side, step, side, step, -1)
        return parts.sum(axis=(2, 4)).reshape(6 * side**2, -1)

    return sums(light * angles) / sums(angles)
