"""Pictures of relit scenes: camera rays through any ray caster, colours from the bake points."""

import numpy as np

from prt_core.errors import (
    expect,
    expect_all,
    expect_array,
    expect_caster,
    expect_offers,
    expect_pair,
    expect_whole,
    shown,
)
from prt_core.light.sky import Sky
from prt_core.runtime.machine import expect_memory
from prt_core.scene import auto_camera, ended_share, expect_camera, hits_in_view, view_rays

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


class CameraRays:
    """What each pixel of a view sees; kept, so that many lights can be shown cheaply.

    Parameters
    ----------
    scene : Scene
    caster : RayCaster
    camera : Camera, optional
        Default: see `auto_camera`.
    width, height : int
        Pixels.
    samples : int
        Along each side of a pixel.

    Attributes
    ----------
    directions : (m, 3) float32
        Of the rays, of all samples in reading order.
    triangle : (m,) int32
        What they meet, -1 where that is nothing.
    points : (m, 3) int32
        The bake points around; -1 where no point is.
    weights : (m, 3) float32
    share : (m,) float32
        Of the rays that end where they did (see `ended_share`).
    """

    def __init__(self, scene, caster, camera=None, width=960, height=540, samples=2):
        camera = auto_camera(scene) if camera is None else expect_camera(camera)
        expect_view(width, height, samples)
        expect_caster(caster)
        self.width, self.height, self.samples, self._scene = width, height, samples, scene
        rays = view_rays(camera, width, height, samples)
        self.directions, n_rays = rays.directions.astype(np.float32), len(rays.directions)
        self.points = np.full((n_rays, 3), -1, np.int32)
        self.weights = np.zeros((n_rays, 3), np.float32)
        self.share = np.ones(n_rays, np.float32)
        triangle, barycentric = hits_in_view(scene, caster, rays)
        self.hit, self.triangle = triangle >= 0, triangle.astype(np.int32)
        # Beyond a fisheye's disc there is no sky either.
        self._sky = ~self.hit & (rays.lengths >= 0)
        for first in range(0, n_rays, _BATCH):
            hit = first + np.flatnonzero(self.hit[first : first + _BATCH])
            face = triangle[hit]
            back = (self.directions[hit] * scene.triangle_normals[face]).sum(axis=1) > 0
            around, weights = scene.hit_points(face, barycentric[hit], back)
            self.points[hit], self.weights[hit] = around, weights
            self.share[hit] = ended_share(scene, face, barycentric[hit], back, around, weights)

    def picture(self, radiance, background=None, pointless=0.0, whole=False):
        """The view under one light.

        Parameters
        ----------
        radiance : (n_points, 3) float32
        background : Sky, or callable((m, 3) directions) -> (m, 3), optional
            What the sky looks like; default black. A `Sky` is filtered for the samples.
        pointless : float
            What surfaces without points look like, in each channel: sides that return no light.
        whole : bool
            Whether the values are of places as they are, and not of all light that arrives: what
            lets light pass shows more of that by the rays that end at it.

        Returns
        -------
        (height, width, 3) float32
            Linear.
        """
        shape = len(self._scene.points), 3
        radiance = expect_array("radiance", radiance, shape, np.float32, -_MOST, _MOST)
        lit = self.lit
        values = np.einsum("pk,pkc->pc", self.weights[lit], radiance[self.points[lit]])
        return self.picture_of(values, background, pointless, whole)

    @property
    def spread(self):
        """Radians between one sample of the middle row and the next; 0 where there is but one."""
        across = self.width * self.samples
        middle = self.height * self.samples // 2 * across
        row = self.directions[middle : middle + across]
        steps = np.linalg.norm(np.diff(row, axis=0), axis=1)
        return float(np.median(steps)) if len(steps) else 0.0

    @property
    def lit(self):
        """(m,) int: the samples that see bake points."""
        return np.flatnonzero(self.points[:, 0] >= 0)

    def picture_of(self, values, background=None, pointless=0.0, whole=False):
        """The view, of what each of its samples shows.

        Parameters
        ----------
        values : (n_lit, 3) float32
            Of the samples `lit`.
        background, pointless, whole
            See `picture`.

        Returns
        -------
        (height, width, 3) float32
            Linear.
        """
        lit = self.lit
        values = expect_array("values", values, (len(lit), 3), np.float32, -_MOST, _MOST)
        image = np.zeros((len(self.hit), 3), np.float32)
        image[self.hit] = pointless
        image[lit] = values if whole else values / self.share[lit, None]
        if isinstance(background, Sky):
            image[self._sky] = background(self.directions[self._sky], self.spread)
        elif background is not None:
            image[self._sky] = background(self.directions[self._sky])
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
