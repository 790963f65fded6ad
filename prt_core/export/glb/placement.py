"""Where an object stands in glTF's axes: y up, as a translation, a rotation and a scale."""

from dataclasses import dataclass

import numpy as np

# glTF's axes, in Blender's: x stays, y is up, z comes towards the viewer. Directions turn so.
TO_GLTF = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
# Parts of the scale below which an object counts as flat: then it keeps none.
_FLAT = 1e-9


@dataclass(frozen=True)
class Placement:
    """A node's place, and the way of vertices into its own space.

    Attributes
    ----------
    translation : (3,) float64
    rotation : (4,) float64
        A unit quaternion x, y, z, w.
    scale : (3,) float64
        One of them is negative where the object is mirrored.
    linear : (3, 3) float64
        Rotation times scale.
    """

    translation: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    linear: np.ndarray

    @classmethod
    def of(cls, matrix):
        """That of an object's (4, 4) matrix in Blender's axes.

        What a matrix shears no node can say: that stays in the vertices.
        """
        linear = TO_GLTF @ matrix[:3, :3] @ TO_GLTF.T
        lengths = np.linalg.norm(linear, axis=0)
        turn, scale = np.eye(3), np.ones(3)
        if (lengths > 0).all() and abs(np.linalg.det(linear / lengths)) > _FLAT:
            turn, upper = np.linalg.qr(linear)
            signs = np.sign(np.diag(upper))
            turn, scale = turn * signs, np.diag(upper) * signs
            if np.linalg.det(turn) < 0:
                turn, scale = turn * [-1, 1, 1], scale * [-1, 1, 1]
        return cls(TO_GLTF @ matrix[:3, 3], quaternion(turn), scale, turn * scale)

    @property
    def mirrored(self):
        """Whether triangles turn their winding round in the world."""
        return bool(self.scale.prod() < 0)

    def local(self, positions):
        """(n, 3) float64 world positions in Blender's axes, in the node's own space."""
        return np.linalg.solve(self.linear, (positions @ TO_GLTF.T - self.translation).T).T

    def local_normals(self, normals):
        """(n, 3) float64 unit normals in the node's own space, of those in Blender's world."""
        turned = normals @ TO_GLTF.T @ self.linear
        length = np.linalg.norm(turned, axis=1, keepdims=True)
        # Where surfaces cancel there is none: up will do.
        return np.where(length > 1e-12, turned / np.maximum(length, 1e-300), [0.0, 1.0, 0.0])

    def node(self):
        """What of a glTF node says the place (dict); what is the default is left out."""
        parts = {
            "translation": (self.translation, np.zeros(3)),
            "rotation": (self.rotation, np.array([0.0, 0, 0, 1])),
            "scale": (self.scale, np.ones(3)),
        }
        return {
            name: value.tolist()
            for name, (value, default) in parts.items()
            if not np.array_equal(value, default)
        }


def quaternion(turn):
    """The unit quaternion x, y, z, w, (4,) float64, of a rotation (3, 3)."""
    # Eigenvector of Bar-Itzhack's symmetric matrix: stable for every angle.
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = turn
    matrix = np.array(
        [
            [xx - yy - zz, yx + xy, zx + xz, zy - yz],
            [yx + xy, yy - xx - zz, zy + yz, xz - zx],
            [zx + xz, zy + yz, zz - xx - yy, yx - xy],
            [zy - yz, xz - zx, yx - xy, xx + yy + zz],
        ]
    )
    vector = np.linalg.eigh(matrix)[1][:, -1]
    vector = vector * (1 if vector[3] >= 0 else -1)
    # A turn by nothing is said as such.
    return np.round(vector, 15) + 0.0
