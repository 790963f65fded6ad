"""Rotations of the light, as 3 x 3 matrices that turn world directions."""

import numpy as np

from prt_core.errors import expect, expect_array, expect_number, expect_numbers


def rotation_about_z(degrees):
    """(3, 3) float64: turns the sky counter-clockwise seen from above, by `degrees`."""
    return _about(2, expect_number("degrees", degrees))


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
    if not isinstance(rotation, list | tuple | np.ndarray):
        return _about(2, expect_number("rotation", rotation))
    if expect_numbers("rotation", rotation).shape == (3,):
        x, y, z = expect_array("rotation", rotation, (3,), np.float64)
        return _about(2, z) @ _about(1, y) @ _about(0, x)
    matrix = expect_array("rotation", rotation, (3, 3), np.float64)
    expect(
        np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6) and np.linalg.det(matrix) > 0,
        "rotation: expected a matrix that turns without scaling or mirroring",
    )
    return matrix


def _about(axis, degrees):
    """(3, 3) float64: turns by `degrees` about one axis of the world."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = cosine
    matrix[first, second], matrix[second, first] = -sine, sine
    return matrix
