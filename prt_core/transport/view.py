"""`View`: from where the points of a scene are looked at. Out is from the surface to the viewer."""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind, expect_vectors
from prt_core.scene import Camera


@dataclass(frozen=True, eq=False)
class View:
    """From where points are looked at: a place, or a direction.

    Parameters
    ----------
    position : (3,) float, optional
        Of the viewer, in the world.
    direction : (3,) or (n_points, 3) float, optional
        Towards a viewer far away, in world axes, of any length but zero: one for all points, or
        one for each.

    Raises
    ------
    PRTError
        Neither is given, or both are; or a direction has no length.
    """

    position: np.ndarray | None = None
    direction: np.ndarray | None = None

    def __post_init__(self):
        expect(
            (self.position is None) != (self.direction is None),
            "view: expected a position or a direction, and not both",
        )
        if self.position is not None:
            position = expect_array("view: position", self.position, (3,), np.float64)
            object.__setattr__(self, "position", position)
            return
        direction = expect_vectors("view: direction", self.direction)
        expect(
            direction.ndim <= 2,
            f"view: direction: expected (3,) or (n_points, 3), got {direction.shape}",
        )
        length = np.linalg.norm(direction, axis=-1, keepdims=True)
        expect((length > 0).all(), "view: direction: expected vectors of length above zero")
        object.__setattr__(self, "direction", direction / length)

    @classmethod
    def of_camera(cls, camera):
        """The `View` of a `camera`: from where it stands, or, orthographic, from far away."""
        expect_kind("camera", camera, Camera)
        if camera.lens == "orthographic":
            return cls(direction=camera.axes[:, 2])
        return cls(camera.position)

    def outgoing(self, points):
        """Directions from points to the viewer.

        Parameters
        ----------
        points : (n_points, 3) float
            Positions in the world: `scene.to_world(scene.points.positions)`.

        Returns
        -------
        (n_points, 3) float64
            Unit vectors in world axes.

        Raises
        ------
        PRTError
            The viewer is in one of the points, or there are directions for another number of them.
        """
        points = expect_array("points", points, (None, 3), np.float64)
        if self.direction is not None:
            shape = self.direction.shape if self.direction.ndim == 1 else (len(points), 3)
            direction = expect_array("view: direction", self.direction, shape)
            return np.broadcast_to(direction, points.shape)
        ways = self.position - points
        length = np.sqrt(np.einsum("nx,nx->n", ways, ways))[:, None]
        expect((length > 0).all(), "view: position: is that of a point; step back from the surface")
        ways /= length
        return ways

    def above(self, points, normals):
        """The view of colours that stay, and are looked at from elsewhere too.

        Sides that face away from the viewer would reflect nothing, and metal there be black. They
        are seen at the slant that they have, from above their surface.

        Parameters
        ----------
        points, normals : (n_points, 3) float
            In the world (see `outgoing`).

        Returns
        -------
        View
            A direction for each point.
        """
        outgoing = self.outgoing(points)
        normals = expect_array("normals", normals, outgoing.shape, np.float64)
        cosine = np.einsum("nx,nx->n", normals, outgoing)[:, None]
        return View(direction=outgoing - 2 * np.minimum(cosine, 0) * normals)
