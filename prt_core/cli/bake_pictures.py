"""`prt bake --show-png`: a picture of the bake under way, written anew as it comes nearer."""

import sys

import numpy as np

from prt_core.evaluate.sequence import PictureWriter
from prt_core.relight.lighting import Lighting
from prt_core.relight.relighter import Relighter
from prt_core.scene import Camera

# Pixels along the longer side; shadow rays a lamp.
_LONGEST, _RAYS = 480, 16


class BakePictures:
    """Writes each picture of a bake (see `prt_core.bake`) from the scene's camera to a file.

    Parameters
    ----------
    path : str or Path
        `NAME.png`.
    light : str or None
        An image, or 'world'; None: all that shines in the scene, or an even sky where nothing does.
    caster : str
    silent : bool
        Whether nothing is said on stderr.
    """

    def __init__(self, path, light, caster, silent):
        self._path, self._light, self._caster, self._silent = path, light, caster, silent
        self._relighter = self._writer = self._scene = None

    def __call__(self, bake):
        if self._relighter is None:
            self._relighter = Relighter(bake, self._caster)
        self._relighter.replace(bake)
        if bake.scene is not self._scene:
            size = (bake.camera or Camera(np.eye(4), 1)).size(_LONGEST)
            self._scene = bake.scene
            self._writer = PictureWriter(
                bake, size, self._caster, view_transform=bake.view_transform
            )
        lighting = self._lighting(bake)
        radiance = self._relighter.radiance(lighting)
        self._writer.write(self._path, radiance, background=self._relighter.sky(lighting))
        if not self._silent:
            print(
                f"{self._path}: from {bake.known_percent:.3g} % of the points, within about "
                f"{bake.error:.1%}",
                file=sys.stderr,
            )

    def _lighting(self, bake):
        lamps = any(not lamp.of_world for lamp in bake.lamps)
        light = self._light
        if light is None:
            light = None if bake.world is None else "world"
            if light is None and not lamps and not bake.scene.emitters:
                light = np.ones((bake.cube_map.n_directions, 3), np.float32)
        more = {"lamps": lamps, "lamp_samples": _RAYS} if self._light is None else {}
        return Lighting(light, emission="all", **more)

    def close(self):
        """Let go of what it holds."""
        if self._relighter is not None:
            self._relighter.close()
