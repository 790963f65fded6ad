"""A relit sequence on disk: one .npz, and one picture where wanted, a frame."""

import re
from pathlib import Path

import numpy as np

from prt_core.errors import expect
from prt_core.evaluate.view import CameraRays, to_srgb, write_png


def frame_path(pattern, frame):
    """The path of one frame: `####` in the pattern is its number, else it is put before the dot."""
    path = Path(pattern)
    found = re.search("#+", path.name)
    if found:
        name = path.name[: found.start()] + f"{frame:0{len(found[0])}d}" + path.name[found.end() :]
    else:
        name = f"{path.stem}_{frame:04d}{path.suffix}"
    return path.with_name(name)


def write_npz(path, colours):
    """Arrays by name into one file, whole or not at all.

    Parameters
    ----------
    path : str or Path
        `NAME.npz`.
    colours : dict of str -> array
    """
    path = Path(path)
    expect(path.suffix == ".npz", f"{path}: expected a name that ends in .npz")
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".part")
    with temporary.open("wb") as file:
        np.savez(file, **colours)
    temporary.replace(path)


class PictureWriter:
    """Pictures of one bake under changing light; what the camera sees is traced once.

    Parameters
    ----------
    bake : Bake
    size : (int, int)
        Pixels.
    caster : str
    """

    def __init__(self, bake, size, caster="auto"):
        self._bake, self._size, self._caster = bake, size, caster
        self._camera = self._rays = None

    def write(self, path, radiance, camera=None, background=None):
        """One picture.

        Parameters
        ----------
        path : str or Path
        radiance : (n_points, 3) float32
        camera : dict, optional
            Default: that of the baked scene (see `evaluate.view`).
        background : callable, optional
            The sky (see `CameraRays.picture`).
        """
        camera = camera or self._bake.camera
        if self._rays is None or camera != self._camera:
            caster = self._bake.make_caster(self._caster)
            try:
                self._rays = CameraRays(self._bake.scene, caster, camera, *self._size)
            finally:
                caster.close()
            self._camera = camera
        write_png(path, to_srgb(self._rays.picture(radiance, background)))
