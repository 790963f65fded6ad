"""Where the lobes of some points are evaluated: parts of blocks, whole blocks, bright texels."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Places:
    """Directions of light, and how they are to be weighed.

    Attributes
    ----------
    directions : (3, m) float32
        Unit vectors: the first part of every block that is cut, the second, and so on; then whole
        blocks; then bright texels.
    solid_angles : (m,) float32
        1 of bright texels, whose light has theirs.
    spread : (m,) float32
        Variance along an axis of the light's directions about each of these.
    core : (k,) int
        Blocks that are cut into parts.
    n_parts : int
    nodes : (l,) int
        Whole blocks, of `FieldNodes`.
    detail : (k n_parts, 3) float32
        What parts have more of the sky's light than their blocks.
    """

    directions: np.ndarray
    solid_angles: np.ndarray
    spread: np.ndarray
    core: np.ndarray
    n_parts: int
    nodes: np.ndarray
    detail: np.ndarray

    def above(self, normal, lowest):
        """What has a cosine of more than `lowest` with a normal (3,), by whole blocks."""
        there = normal @ self.directions > lowest
        n_core = len(self.core) * self.n_parts
        core = there[:n_core].reshape(self.n_parts, -1).any(axis=0)
        nodes = there[n_core : n_core + len(self.nodes)]
        there[:n_core].reshape(self.n_parts, -1)[:] = core
        there[n_core + len(nodes) :] = True
        return Places(
            self.directions.compress(there, axis=1), self.solid_angles[there], self.spread[there],
            self.core[core], self.n_parts, self.nodes[nodes], self.detail[there[:n_core]],
        )  # fmt: skip
