"""Rotations of the light, as 3 x 3 matrices that turn world directions."""

import numpy as np
from scipy.spatial.transform import Rotation

from prt_core.errors import expect, expect_array


def rotation_about_z(degrees):
    """(3, 3) float64: turns the sky counter-clockwise seen from above, by `degrees`."""
    return Rotation.from_euler("z", degrees, degrees=True).as_matrix()


def rotation_matrix(rotation):
    """A rotation in any of the forms this library takes, as a matrix.

    Parameters
    ----------
    rotation : None, float, (3,) or (3, 3) array
        Nothing; degrees about z; Euler angles x, y, z in degrees (Blender's XYZ order); a matrix.

    Raises
    ------
    PRTError
        The matrix is not a rotation, or the shape is none of these.
    """
    if rotation is None:
        return np.eye(3)
    array = np.asarray(rotation, np.float64)
    expect(np.isfinite(array).all(), "rotation: expected finite angles, got NaN or infinity")
    if array.ndim == 0:
        return rotation_about_z(float(array))
    if array.shape == (3,):
        return Rotation.from_euler("xyz", array, degrees=True).as_matrix()
    matrix = expect_array("rotation", array, (3, 3), np.float64)
    expect(
        np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6) and np.linalg.det(matrix) > 0,
        "rotation: expected a matrix that turns without scaling or mirroring",
    )
    return matrix
