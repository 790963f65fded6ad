"""What a refined mesh keeps of the one it came from, and the paint between its corners."""

import hashlib
from dataclasses import dataclass

import numpy as np

# Weights that differ by less are the same place of a face.
_STEP = 1e-9


@dataclass(frozen=True)
class Refined:
    """Where the corners of a refined mesh were in the one that was split.

    Attributes
    ----------
    around : (n_corners, 3) int32
        The corners there around each; of a corner that stayed all three are that corner.
    weights : (n_corners, 3) float32
    vertex_round : (n_vertices,) int32
        The round of refinement that made each vertex, from 1 on; 0 for those that were there.
    n_before : int
        Corners of the mesh that was split.
    """

    around: np.ndarray
    weights: np.ndarray
    vertex_round: np.ndarray
    n_before: int


class RefinedPaint:
    """The `Paint` of a mesh that was split: that of the faces that its corners lie in.

    Parameters
    ----------
    paint : Paint
    around : (n_corners, 3) int
        Corners of the mesh that was split, around each of this one's.
    weights : (n_corners, 3) float
    """

    def __init__(self, paint, around, weights):
        self._paint, self._around, self._weights = paint, around, weights

    def _whole(self, corners):
        """(m, 3) corners of the faces, and (m, 3, 3) their weights at each of `corners`."""
        corners = np.asarray(corners, np.int64)
        around, weights = self._around[corners], self._weights[corners]
        # Corners of whole faces are each around themselves alone.
        stayed = (around == around[:, :, :1]).all(axis=(1, 2))
        return (
            np.where(stayed[:, None], around[:, :, 0], around[:, 0]),
            np.where(stayed[:, None, None], np.eye(3), weights),
        )

    def at(self, corners, weights):
        """See `Paint`."""
        whole, local = self._whole(corners)
        return self._paint.at(whole, np.einsum("mk,mkj->mj", np.asarray(weights), local))

    def alike(self, corners):
        """See `Paint`."""
        whole, local = self._whole(corners)
        kind = self._paint.alike(whole)
        key = np.column_stack([kind, np.rint(local.reshape(-1, 9) / _STEP)])
        return np.unique(key, axis=0, return_inverse=True)[1].reshape(-1)

    def texels(self, corners):
        """See `Paint`."""
        whole, local = self._whole(corners)
        return self._paint.texels(whole) * np.abs(np.linalg.det(local))

    def digest(self):
        """See `Paint`."""
        digest = hashlib.blake2b(self._paint.digest(), digest_size=16)
        digest.update(np.ascontiguousarray(self._around, np.int64))
        digest.update(np.ascontiguousarray(self._weights, np.float64))
        return digest.digest()
