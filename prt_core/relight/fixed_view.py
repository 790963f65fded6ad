"""The view of a camera's image that was baked with gloss: it is known once and for all."""

import numpy as np

from prt_core.errors import expect
from prt_core.relight.gloss import Gloss
from prt_core.relight.glossy_points import METAL
from prt_core.transport import View
from prt_core.transport.view_weights import ViewWeights


class FixedView:
    """What the pixels of a baked image show of gloss.

    Parameters
    ----------
    bake : Bake
        With gloss, and a camera's image.
    gloss : Gloss, optional
        Of the bake; made where it is not given.

    Attributes
    ----------
    view : View
        Each point of the image is seen from the camera, all others from behind.
    """

    def __init__(self, bake, gloss=None):
        expect(
            bake.reflections and getattr(bake.scene.image, "camera", None) is not None,
            "image: this bake holds none with gloss; bake with --gloss and --camera-pixels",
        )
        self._bake, self._gloss = bake, Gloss(bake) if gloss is None else gloss
        points, image = bake.scene.points, bake.scene.image
        # What faces away from the viewer is not worked on.
        outgoing = -points.geometric_normals.astype(np.float64)
        world = bake.scene.to_world(points.positions[image.point])
        outgoing[image.point] = View.of_camera(image.camera).outgoing(world)
        self.view = View(direction=outgoing)

    def weights(self):
        """The `ViewWeights` of its points."""
        bake, gloss = self._bake, self._gloss
        return ViewWeights(
            bake.scene, bake.transport, bake.reflections, gloss.lobes, self.view.direction,
            gloss.narrowest, METAL,
        )  # fmt: skip
