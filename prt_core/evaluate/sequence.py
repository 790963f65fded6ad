"""A relit sequence on disk: one .npz, and one picture where wanted, a frame."""

import re
import zipfile

import numpy as np

from prt_core.errors import (
    expect,
    expect_all,
    expect_kind,
    expect_offers,
    expect_pair,
    expect_path,
    expect_whole,
    shown,
)
from prt_core.evaluate.png import to_display, write_png
from prt_core.evaluate.view import CameraRays, expect_view
from prt_core.runtime.files import written
from prt_core.scene import expect_camera


def frame_path(pattern, frame):
    """The path of one frame: `####` in the pattern is its number, else it is put before the dot."""
    path, frame = expect_path("frames", pattern), expect_whole("frame", frame, -(10**9), 10**9)
    digits = re.search("#+", path.name)
    if digits:
        name = (
            path.name[: digits.start()] + f"{frame:0{len(digits[0])}d}" + path.name[digits.end() :]
        )
    else:
        name = f"{path.stem}_{frame:04d}{path.suffix}"
    return path.with_name(name)


def light_path(pattern, name):
    """The path of what is shown under one of several lights: its name stands at the end, before
    the number of a frame. What not every system allows in a name becomes `_`."""
    path, name = expect_path("lights", pattern), expect_kind("name", name, str, "the name of one")
    name = "".join(c if c.isalnum() or c in " -_." else "_" for c in name).strip(" .")
    expect(name, f"{path}: expected the name of a light, got an empty one")
    start, number = re.fullmatch("(.*?)(_?#*)", path.stem).groups()
    return path.with_name(f"{start}_{name}{number}{path.suffix}")


def light_paths(pattern, names):
    """`light_path` of each of several lights, by name; of an empty name the pattern itself.

    Raises
    ------
    PRTError
        Two would have one file, of one name, or where capitals and small letters are the same.
    """
    paths, owners = {}, {}
    for name in expect_all("names", names, str, "names of lights"):
        paths[name] = light_path(pattern, name) if name else expect_path("lights", pattern)
        file = paths[name].name.casefold()
        expect(
            file not in owners,
            f"{paths[name]}: would be of two lights, '{owners.get(file)}' and '{name}'; rename one "
            "of them",
        )
        owners[file] = name
    return paths


def write_npz(path, colours):
    """Arrays by name into one file, whole or not at all.

    Parameters
    ----------
    path : str or Path
        `NAME.npz`.
    colours : dict of str -> array
    """
    path = expect_path("colours", path)
    expect(path.suffix.lower() == ".npz", f"{path}: expected a name that ends in .npz")
    good = isinstance(colours, dict) and all(isinstance(name, str) for name in colours)
    expect(good, f"{path}: expected arrays by name, got {shown(colours)}")
    # Not `np.savez`, to which a name such as 'file' is an argument of its own.
    with written(path) as part, zipfile.ZipFile(part, "w") as file:
        for name, array in colours.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)


class PictureWriter:
    """Pictures of one bake under changing light; what the camera sees is traced once.

    Parameters
    ----------
    bake : Bake
    size : (int, int)
        Pixels.
    caster : str
    camera : Camera, optional
        Default: that of the baked scene.
    view_transform : ViewTransform, optional
        How pictures are shown (see `to_display`).

    Attributes
    ----------
    view_transform
        May change from one picture to the next.
    """

    def __init__(self, bake, size, caster="auto", camera=None, view_transform=None):
        self._bake = expect_offers("bake", bake, ("scene", "camera"), "what `load` returns")
        self._size = expect_pair("size", size)
        self._caster = expect_kind("caster", caster, str, "the name of one")
        expect_view(*self._size)
        self._own = bake.camera if camera is None else expect_camera(camera)
        self._camera = self._rays = None
        self.view_transform = view_transform

    def write(self, path, radiance, camera=None, background=None):
        """One picture of what points send.

        Parameters
        ----------
        path : str or Path
        radiance : (n_points, 3) float32
        camera : Camera, optional
            Default: the writer's own.
        background : callable, optional
            The sky (see `CameraRays.picture`).
        """
        self.write_picture(path, self.rays(camera).picture(radiance, background))

    def write_picture(self, path, picture):
        """One linear picture (height, width, 3) float32."""
        write_png(path, to_display(picture, self.view_transform))

    def rays(self, camera=None):
        """The `CameraRays` of a camera, kept until there is another.

        Parameters
        ----------
        camera : Camera, optional
            Default: the writer's own.
        """
        camera = self._own if camera is None else camera
        if self._rays is None or camera != self._camera:
            caster = self._bake.make_caster(self._caster, "camera")
            try:
                self._rays = CameraRays(self._bake.scene, caster, camera, *self._size)
            finally:
                caster.close()
            self._camera = camera
        return self._rays
