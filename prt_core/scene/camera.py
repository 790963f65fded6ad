"""A camera: the rays through its pixels, and one that sees all of a scene."""

import warnings
from dataclasses import asdict, dataclass

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_kind,
    expect_number,
    expect_offers,
    expect_one_of,
    expect_pair,
    expect_whole,
)
from prt_core.runtime.machine import expect_memory
from prt_core.scene.lenses import LENSES, panorama_directions

SENSOR_FITS = ("auto", "horizontal", "vertical")


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera that looks along its -z, with +y up, as Blender has it.

    Parameters
    ----------
    matrix : (4, 4) float64
        Camera to world; how long its axes are does not matter.
    tangent : float
        Of half the angle along the side of the picture that `sensor_fit` names; of an
        orthographic lens half of that side in world units; no matter for a panorama.
    lens : {"perspective", "orthographic", "equirectangular", "equidistant", "equisolid"}
        The last two are fisheyes.
    sensor_fit : {"auto", "horizontal", "vertical"}
        Of which side of the picture; `auto`: of the longer one.
    shift : (2,) float
        To the right and up, in lengths of that side; of a panorama in widths and heights of the
        picture.
    pixel_aspect : (2,) float
        Width and height of a pixel.
    clip : (2,) float
        Depth in front of the camera, or distance for a panorama, from where and up to where
        things are seen.
    panorama : (4,) float
        Radians from where to where an equirectangular picture goes: longitude to the right of
        straight ahead, latitude above it.
    fisheye : (4,) float
        Full angle of view in radians; and of an equisolid lens its focal length, and the width
        and height of its sensor in the same unit, the height as it is for `sensor_fit` vertical.
    frame : (int, int)
        Width and height in pixels of the pictures that it is set for.

    Raises
    ------
    PRTError
        The matrix has an axis without length, or a value is out of range.
    """

    matrix: np.ndarray
    tangent: float
    lens: str = "perspective"
    sensor_fit: str = "auto"
    shift: tuple = (0.0, 0.0)
    pixel_aspect: tuple = (1.0, 1.0)
    clip: tuple = (0.0, np.inf)
    panorama: tuple = (-np.pi, np.pi, -np.pi / 2, np.pi / 2)
    fisheye: tuple = (np.pi, 10.5, 36.0, 24.0)
    frame: tuple = (960, 540)

    def __post_init__(self):
        matrix = expect_array("camera: matrix", self.matrix, (4, 4), np.float64)
        expect(
            matrix[:3, :3].any(axis=0).all(),
            "camera: expected a matrix whose axes have a length; a scale of 0 has none",
        )
        checked = {
            "matrix": matrix,
            "tangent": expect_number("camera: tangent", self.tangent, above=0),
            "lens": expect_one_of("camera: lens", self.lens, LENSES),
            "sensor_fit": expect_one_of("camera: sensor_fit", self.sensor_fit, SENSOR_FITS),
            "frame": expect_pair("camera: frame", self.frame),
        }
        for name, count in (("shift", 2), ("pixel_aspect", 2), ("panorama", 4), ("fisheye", 4)):
            values = expect_array(f"camera: {name}", getattr(self, name), (count,), np.float64)
            checked[name] = tuple(float(value) for value in values)
        for name in ("pixel_aspect", "fisheye"):
            expect(min(checked[name]) > 0, f"camera: {name}: expected numbers above 0")
        near, far = self._clip()
        checked["clip"] = near, far
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def _clip(self):
        good = isinstance(self.clip, list | tuple | np.ndarray) and len(self.clip) == 2
        expect(good, "camera: clip: expected two numbers")
        near = expect_number("camera: clip", self.clip[0], 0)
        # A file of numbers has no infinity.
        far = self.clip[1]
        endless = far is None or (isinstance(far, float) and far == np.inf)
        return near, np.inf if endless else expect_number("camera: clip", far, above=near)

    def __eq__(self, other):
        return isinstance(other, Camera) and self.to_dict() == other.to_dict()

    __hash__ = None

    @property
    def position(self):
        """(3,) float64: in the world."""
        return self.matrix[:3, 3]

    @property
    def axes(self):
        """(3, 3) float64: unit vectors to the right, up and back, as columns."""
        return self.matrix[:3, :3] / np.linalg.norm(self.matrix[:3, :3], axis=0)

    def to_dict(self):
        """As numbers, texts and lists, which a store keeps; `Camera(**values)` makes it again."""
        values = {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(self).items()}
        far = None if self.clip[1] == np.inf else self.clip[1]
        return {**values, "matrix": self.matrix.tolist(), "clip": [self.clip[0], far]}

    def size(self, longest=960):
        """(width, height) of a picture of the shape of its frame.

        Parameters
        ----------
        longest : int
            Pixels along the longer side.
        """
        factor = longest / max(self.frame)
        return tuple(max(1, round(side * factor)) for side in self.frame)


@dataclass(frozen=True)
class ViewRays:
    """The rays of the samples of a picture, in world space.

    Attributes
    ----------
    origins, directions : (m, 3) float64
        Directions are unit vectors.
    lengths : (m,) float64
        How far things are seen, from the origins on; below 0 where a lens shows nothing.
    """

    origins: np.ndarray
    directions: np.ndarray
    lengths: np.ndarray


def view_rays(camera, width, height, samples):
    """The `ViewRays` of a picture, in reading order of its height * samples x width * samples.

    Parameters
    ----------
    camera : Camera
    width, height : int
    samples : int
        Along each side of a pixel.
    """
    camera = expect_camera(camera)
    width, height = (expect_whole("image", side, 1) for side in (width, height))
    samples = expect_whole("samples", samples, 1)
    # Twenty numbers of float64 for each ray while they are made.
    expect_memory(
        f"image: {width} x {height} pixels", 160.0 * width * height * samples**2, "take fewer"
    )
    x = (np.arange(width * samples) + 0.5) / (samples * width)
    y = 1 - (np.arange(height * samples) + 0.5) / (samples * height)
    x, y = (values.ravel() for values in np.meshgrid(x, y))
    near, far = camera.clip
    if camera.lens in ("perspective", "orthographic"):
        x, y = _on_plane(camera, width, height, x, y)
        flat, ahead = np.zeros_like(x), -np.ones_like(x)
        if camera.lens == "orthographic":
            starts = np.stack([x, y, flat], axis=1)
            local = np.stack([flat, flat, ahead], axis=1)
            depth = np.ones_like(x)
        else:
            starts = np.zeros((len(x), 3))
            local = np.stack([x, y, ahead], axis=1)
            length = np.linalg.norm(local, axis=1)
            local /= length[:, None]
            depth = 1 / length
        first, lengths = near / depth, (far - near) / depth
    else:
        local, shown = panorama_directions(camera, x, y, width, height)
        starts, first = np.zeros((len(x), 3)), np.full(len(x), near)
        lengths = np.where(shown, far - near, -1.0)
    starts = camera.position + (starts + local * first[:, None]) @ camera.axes.T
    return ViewRays(starts, local @ camera.axes.T, lengths)


def _on_plane(camera, width, height, x, y):
    """Where samples lie on the plane one unit ahead; x and y are 0..1 to the right and up."""
    wide, high = width * camera.pixel_aspect[0], height * camera.pixel_aspect[1]
    fit = camera.sensor_fit
    if fit == "auto":
        fit = "horizontal" if wide >= high else "vertical"
    fitted = wide if fit == "horizontal" else high
    side = 2 * camera.tangent
    right, up = camera.shift
    return (
        ((x - 0.5) * wide / fitted + right) * side,
        ((y - 0.5) * high / fitted + up) * side,
    )


def camera_rays(camera, width, height, samples):
    """The directions of `view_rays`, as (height * samples * width * samples, 3) float64.

    Parameters
    ----------
    camera, width, height, samples
        See `view_rays`.
    """
    return view_rays(camera, width, height, samples).directions


def auto_camera(scene):
    """A `Camera` that sees the whole of a `scene` from the front, a little from above."""
    expect_offers("scene", scene, ("centre", "size"), "a Scene")
    away = np.array([0.35, -0.85, 0.45])
    away /= np.linalg.norm(away)
    right = np.cross([0, 0, 1.0], away)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([right, np.cross(away, right), away])
    matrix[:3, 3] = scene.centre + away * scene.size * 1.6
    return Camera(matrix, 0.42)


def expect_camera(camera):
    """`camera`, where it is a `Camera`; a dict with its matrix and tangent for one release."""
    if isinstance(camera, dict) and set(camera) == {"matrix", "tangent"}:
        warnings.warn(
            "camera: a dict is a Camera(matrix, tangent) now", DeprecationWarning, stacklevel=3
        )
        return Camera(**camera)
    return expect_kind("camera", camera, Camera)
