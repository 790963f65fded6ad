"""Pictures of relit scenes: camera rays through any ray caster, colours from the bake points."""

import struct
import zlib

import numpy as np

from prt_core.errors import (
    expect,
    expect_all,
    expect_array,
    expect_caster,
    expect_number,
    expect_numbers,
    expect_offers,
    expect_pair,
    expect_path,
    expect_whole,
    shown,
)
from prt_core.runtime.files import written
from prt_core.runtime.machine import expect_memory
from prt_core.scene import camera_rays, expect_camera

_BATCH = 1 << 20


# Bytes of a sample of a picture while it is made, at 2 x 2 samples a pixel.
_SAMPLE_BYTES = 200
# Radiance that float32 holds several times.
_MOST = 1e37


def expect_view(width, height, samples=2):
    """Raise `PRTError` where a picture of so many pixels cannot be made on this machine."""
    width, height = expect_pair("size", (width, height), 1, 1 << 20)
    samples = expect_whole("samples", samples, 1, 16)
    needed = _SAMPLE_BYTES * width * height * samples**2
    expect_memory(f"size: a picture of {width} x {height}", needed, "take a smaller one")


def auto_camera(scene, width=960, height=540):
    """A camera that sees the whole scene from the front, a little from above.

    Parameters
    ----------
    scene : Scene
    width, height : int
        Of the picture.

    Returns
    -------
    dict
        `matrix` (4 x 4, camera to world), `tangent` of half the wider angle.
    """
    expect_offers("scene", scene, ("centre", "size"), "a Scene")
    away = np.array([0.35, -0.85, 0.45])
    away /= np.linalg.norm(away)
    right = np.cross([0, 0, 1.0], away)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([right, np.cross(away, right), away])
    matrix[:3, 3] = scene.centre + away * scene.size * 1.6
    return {"matrix": matrix.tolist(), "tangent": 0.42}


class CameraRays:
    """What each pixel of a view sees; kept, so that many lights can be shown cheaply.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    camera : dict
        See `auto_camera`.
    width, height : int
        Pixels.
    samples : int
        Along each side of a pixel.
    """

    def __init__(self, scene, caster, camera=None, width=960, height=540, samples=2):
        camera = auto_camera(scene) if camera is None else camera
        expect_view(width, height, samples)
        expect_caster(caster)
        expect_camera(camera)
        self.width, self.height, self.samples, self._scene = width, height, samples, scene
        matrix = np.asarray(camera["matrix"], np.float64)
        directions = camera_rays(camera, width, height, samples)
        self.directions = directions.astype(np.float32)
        origin = scene.to_frame(matrix[:3, 3])
        self.points = np.full((len(directions), 3), -1, np.int32)
        self.weights = np.zeros((len(directions), 3), np.float32)
        self.hit = np.zeros(len(directions), bool)
        for first in range(0, len(directions), _BATCH):
            part = slice(first, first + _BATCH)
            ways = self.directions[part]
            found = caster.intersect(np.broadcast_to(origin, ways.shape), ways)
            hit = np.flatnonzero(found.triangle >= 0)
            triangle = found.triangle[hit]
            back = (ways[hit] * scene.triangle_normals[triangle]).sum(axis=1) > 0
            around, weights = scene.hit_points(triangle, found.barycentric[hit], back)
            self.points[first + hit], self.weights[first + hit] = around, weights
            self.hit[first + hit] = True

    def picture(self, radiance, background=None):
        """The view under one light.

        Parameters
        ----------
        radiance : (n_points, 3) float32
        background : callable((m, 3) directions) -> (m, 3), optional
            What the sky looks like; default black.

        Returns
        -------
        (height, width, 3) float32
            Linear. Sides that return no light are black.
        """
        shape = len(self._scene.points), 3
        radiance = expect_array("radiance", radiance, shape, np.float32, -_MOST, _MOST)
        lit = self.points[:, 0] >= 0
        image = np.zeros((len(self.hit), 3), np.float32)
        image[lit] = np.einsum("pk,pkc->pc", self.weights[lit], radiance[self.points[lit]])
        if background is not None:
            sky = ~self.hit
            image[sky] = background(self.directions[sky])
        s = self.samples
        return image.reshape(self.height, s, self.width, s, 3).mean(axis=(1, 3))


def render_view(bake, radiance, caster, width=960, height=540, background=None):
    """One picture from the bake's camera.

    Parameters
    ----------
    bake : Bake
    radiance : (n_points, 3) float32
    caster : RayCaster
    width, height : int
    background : callable((m, 3) directions) -> (m, 3), optional
        See `CameraRays.picture`.

    Returns
    -------
    (height, width, 3) float32
        Linear.
    """
    expect_offers("bake", bake, ("scene", "camera"), "what `load` returns")
    rays = CameraRays(bake.scene, caster, bake.camera, width, height)
    return rays.picture(radiance, background)


def to_srgb(linear, exposure=0.0):
    """Linear radiance as sRGB bytes; brighter than white is cut.

    Parameters
    ----------
    linear : (..., 3) float
    exposure : float
        Stops.

    Returns
    -------
    (..., 3) uint8
    """
    stops = expect_number("exposure", exposure, -64, 64)
    linear = expect_numbers("linear", linear)
    expect(not np.isnan(linear).any(), "linear: expected no NaN")
    with np.errstate(over="ignore"):
        value = np.clip(np.asarray(linear, np.float32) * np.float32(2.0**stops), 0, 1)
    curve = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    return (curve * 255 + 0.5).astype(np.uint8)


def write_png(path, image):
    """Write an `image` of (height, width, 3) uint8 sRGB pixels to a `path`, whole or not at all."""
    path = expect_path("picture", path)
    expect(path.suffix.lower() == ".png", f"{path}: expected a name that ends in .png")
    data = png_bytes(image)
    with written(path) as part:
        part.write_bytes(data)


def png_bytes(image):
    """(height, width, 3) uint8 sRGB pixels as a PNG file (ISO/IEC 15948)."""
    image = expect_array("picture", image, (None, None, 3))
    expect(
        image.dtype == np.uint8 and image.size,
        f"picture: expected some pixels of uint8, got {shown(image)}",
    )
    height, width, _ = image.shape
    flat = image.reshape(height, -1)
    # Filter 2: each row less the one above it.
    rows = np.full((height, 1 + 3 * width), 2, np.uint8)
    rows[:, 1:] = flat
    rows[1:, 1:] -= flat[:-1]
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = (b"IHDR", header), (b"sRGB", b"\0"), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


def contact_sheet(images, labels, columns):
    """Pictures side by side with a line of text under each.

    Parameters
    ----------
    images : sequence of (height, width, 3) uint8
    labels : sequence of str
    columns : int

    Returns
    -------
    (n, m, 3) uint8
    """
    from PIL import Image, ImageDraw, ImageFont

    pictures = expect_all("images", images, np.ndarray, "pictures")
    expect(pictures, "images: expected at least one")
    images = [expect_array("images", picture, pictures[0].shape) for picture in pictures]
    good = images[0].ndim == 3 and all(picture.dtype == np.uint8 for picture in images)
    expect(good, f"images: expected (height, width, 3) uint8, got {shown(images[0])}")
    labels = expect_all("labels", labels, str, "texts")
    expect(len(labels) == len(images), f"labels: expected {len(images)}, got {len(labels)}")
    columns = expect_whole("columns", columns, 1, 1000)
    height, width = images[0].shape[:2]
    bar, rows = 26, -(-len(images) // columns)
    sheet = Image.new("RGB", (columns * width, rows * (height + bar)), (24, 24, 24))
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    for index, (image, label) in enumerate(zip(images, labels, strict=True)):
        x, y = index % columns * width, index // columns * (height + bar)
        sheet.paste(Image.fromarray(image), (x, y))
        draw.text((x + 8, y + height + 3), label, fill=(225, 225, 225), font=font)
    return np.asarray(sheet)
