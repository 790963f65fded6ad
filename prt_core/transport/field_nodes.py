"""Blocks of several sizes, each where its light is: what lobes over a field are evaluated at.

A lobe that changes little over a large block needs one value for all of it, if it is taken where
the light of the block comes from in the mean, and if it is the lobe's mean over light that spreads
so far. So there are blocks of the field, blocks twice as wide, and so on; and each has a direction
and a spread which belong to the light.
"""

from functools import cached_property, lru_cache

import numpy as np

from prt_core.sphere import Blocks, CubeMap

# Blocks along an edge of the largest ones, at least.
_LARGEST = 2


class FieldNodes:
    """Blocks of a field and those of two, four, ... times their width, the smallest first.

    Parameters
    ----------
    side : int
        Of the smallest along an edge of a face.

    Attributes
    ----------
    sides : tuple of int
        Of each size.
    first : (n_sizes + 1,) int
        Where the blocks of each size begin.
    """

    def __init__(self, side):
        sides = [side]
        while sides[-1] % 2 == 0 and sides[-1] // 2 >= _LARGEST:
            sides.append(sides[-1] // 2)
        self.sides = tuple(sides)
        self.first = np.concatenate([[0], np.cumsum([6 * n * n for n in sides])])

    def __len__(self):
        return int(self.first[-1])

    @cached_property
    def solid_angles(self):
        """(n_nodes,) float32."""
        angles = [CubeMap(side).solid_angles for side in self.sides]
        return np.concatenate(angles).astype(np.float32)

    @cached_property
    def _shares(self):
        """Of each size but the largest: (6 side^2,) float32 parts of blocks in the next larger."""
        shares = []
        for side, begin, end in zip(self.sides[1:], self.first, self.first[1:], strict=False):
            own = self.solid_angles[begin:end].astype(np.float64)
            whole = _fours(own, side).reshape(6, side, 1, side, 1)
            parts = own.reshape(6, side, 2, side, 2) / whole
            shares.append(parts.reshape(-1).astype(np.float32))
        return shares

    def means(self, values):
        """Of values of the smallest blocks (..., n_blocks): of all (..., n_nodes), float32."""
        return np.concatenate([values, self.larger(values)], axis=-1)

    def larger(self, values):
        """Of values of the smallest blocks (..., n_blocks) float32: of all that are larger."""
        means, every = values, [values[..., :0]]
        for side, share in zip(self.sides[1:], self._shares, strict=True):
            means = _fours(means * share, side)
            every.append(means)
        return np.concatenate(every, axis=-1)

    def placed(self, cube_map, weights):
        """Where light comes from.

        Parameters
        ----------
        cube_map : CubeMap
        weights : (n_directions,) float
            How much light comes from each of its texels; not negative.

        Returns
        -------
        directions : (n_nodes, 3) float32
            Unit vectors: the means in each block by weight; middles of blocks without any.
        spread : (n_nodes,) float32
            Variance of the directions about that along one axis.
        """
        angles = cube_map.solid_angles
        # Blocks without light are placed as if it were even.
        weights = np.maximum(weights, 1e-6 * (weights @ angles) / angles.sum() + 1e-30) * angles
        sums = [Blocks(cube_map, self.sides[0]).sums(np.column_stack([
            weights, weights[:, None] * cube_map.directions]))]  # fmt: skip
        for side in self.sides[1:]:
            sums.append(_fours(sums[-1].T, side).T)
        sums = np.concatenate(sums)
        means = sums[:, 1:] / sums[:, :1]
        lengths = np.linalg.norm(means, axis=1)
        return (means / lengths[:, None]).astype(np.float32), (1 - lengths).astype(np.float32)


@lru_cache(maxsize=8)
def field_nodes(side):
    """The `FieldNodes` of a side, which are kept."""
    return FieldNodes(side)


def _fours(values, side):
    """Sums over each 2 x 2 of blocks (..., 6 (2 side)^2): (..., 6 side^2)."""
    lead = values.shape[:-1]
    parts = values.reshape(*lead, 6, side, 2, side, 2)
    # Much quicker than a sum over two short axes.
    total = parts[..., 0, :, 0] + parts[..., 0, :, 1]
    total += parts[..., 1, :, 0]
    total += parts[..., 1, :, 1]
    return total.reshape(*lead, -1)
