"""Environment maps: equirectangular images, and their light on the directions of a cube map."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_kind,
    expect_number,
    expect_path,
    expect_whole,
    shown,
)
from prt_core.light.images import read_picture, told
from prt_core.runtime.threads import on_all_cores
from prt_core.sphere import CubeMap, rotation_matrix

# Parts of pixels a texel is averaged over, at least: what is even, and what is bright. With these
# relit colours are 0.02 % from those of fifty times as many.
_EVEN_SAMPLES, _BRIGHT_SAMPLES = 80, 4000
# With fewer than these the small texels at corners of faces may get no part of any pixel.
_LEAST_SAMPLES = 10
_EVEN_HEIGHT = 256
_BAND = 1 << 16
# Light beyond this overflows float32 where it is squared, or summed over the sphere.
BRIGHTEST = 1e15
# Pixels above so many times the mean count as small sources.
_BRIGHT = 4.0


def equirectangular(directions):
    """Image coordinates of directions, as Cycles looks them up.

    Parameters
    ----------
    directions : (m, 3) float
        Unit vectors towards the light.

    Returns
    -------
    u, v : (m,) float
        Both in 0..1; v = 1 is straight up, so the image's row is (1 - v) * height.
    """
    x, y, z = np.moveaxis(directions, -1, 0)
    return 0.5 - np.arctan2(y, x) / (2 * np.pi), 0.5 + np.arcsin(np.clip(z, -1, 1)) / np.pi


@dataclass
class EnvironmentMap:
    """Light from infinitely far away.

    Parameters
    ----------
    pixels : (height, width, 3) float32
        Linear Rec.709 radiance, equirectangular, straight up in the first row.
    name : str
        For messages.
    notes : tuple of str
        What was read and converted, where there was a choice (see `read_picture`).
    """

    pixels: np.ndarray
    name: str = "environment"
    notes: tuple = ()

    def __post_init__(self):
        name = expect_kind("environment: name", self.name, str, "text")
        pixels = expect_array(f"{name}: pixels", self.pixels, (None, None, 3), np.float32)
        expect(pixels.size > 0, f"{name}: the image has no pixels")
        low, high = pixels.min(), pixels.max()
        expect(
            low >= 0,
            f"{name}: radiance expected >= 0, the smallest value is {low:.4g}; "
            f"{told((pixels < 0).any(axis=-1), 'negative')}; repair the image first, as with "
            "'oiiotool in.exr --clamp:min=0 -o out.exr'",
        )
        expect(
            high <= BRIGHTEST,
            f"{name}: radiance expected at most {BRIGHTEST:g}, the largest value is {high:.4g}; "
            f"{told((pixels > BRIGHTEST).any(axis=-1), 'brighter')}; repair the image first, as "
            "with 'oiiotool in.exr --clamp:max=1e6 -o out.exr'",
        )
        self.pixels = pixels

    @classmethod
    def read(cls, path):
        """The map of an .exr or .hdr image.

        Parameters
        ----------
        path : str or Path

        Returns
        -------
        EnvironmentMap

        Raises
        ------
        PRTError
            It cannot be read, or is anything but twice as wide as high.
        """
        pixels, notes = read_picture(path)
        height, width = pixels.shape[:2]
        expect(
            width == 2 * height or (height == 1 and width == 1),
            f"{path}: an equirectangular image is twice as wide as high, got {width} x {height}",
        )
        # Negative radiance comes from resampling filters; a trace of it is cut, more is an error.
        negative = -float(np.minimum(pixels, 0).sum(dtype=np.float64))
        if 0 < negative < 1e-4 * float(np.maximum(pixels, 0).sum(dtype=np.float64)):
            pixels = np.maximum(pixels, 0)
        return cls(pixels, str(path), tuple(notes))

    def to_cube_map(self, cube_map, rotation=None, strength=1.0, finer=1):
        """The mean radiance of every texel; no pixel's energy is lost or counted twice.

        Each pixel is cut into equal-area parts and each part goes to the texel it falls into.
        What is brighter than a few times the mean (a sun) is divided by the texels' exact solid
        angles, so that its power is kept however small it is; the rest by the area of the parts
        in each texel, so that an even sky stays even.

        Parameters
        ----------
        cube_map : CubeMap
        rotation : see `rotation_matrix`
            Turns the light.
        strength : float
        finer : int
            How many texels along an edge make up one that is to be right by itself: pixels are cut
            for those. Of light that only has more detail than the texels of a bake.

        Returns
        -------
        (n_directions, 3) float32
        """
        expect_kind("cube_map", cube_map, CubeMap)
        parts = expect_whole("finer", finer, 1) ** 2
        expect_strength(self.name, self.pixels, strength)
        matrix = rotation_matrix(rotation)
        if self.pixels.shape[:2] == (1, 1):
            light = np.repeat(self.pixels[0].astype(np.float64), cube_map.n_directions, axis=0)
            return (light * strength).astype(np.float32)
        even, bright = self.layers
        samples = max(_EVEN_SAMPLES / parts, _LEAST_SAMPLES)
        light, covered = sums_on_texels(cube_map, matrix, *even, samples)
        light /= np.maximum(covered, 1e-30)[:, None]
        if bright is not None:
            sums, _ = sums_on_texels(cube_map, matrix, *bright, _BRIGHT_SAMPLES / parts)
            light += sums / cube_map.solid_angles[:, None]
        return (light * strength).astype(np.float32)

    @cached_property
    def layers(self):
        """What is even and what is bright (or None): rows, columns, shape, values of pixels."""
        height, width = self.pixels.shape[:2]
        mean = self.pixels.mean(axis=(0, 1), dtype=np.float64)
        small = self.pixels > _BRIGHT * mean
        base = np.where(small, mean, self.pixels)
        rows, columns = np.nonzero(small.any(axis=-1))
        bright = None
        if len(rows):
            values = (self.pixels - base)[rows, columns]
            bright = rows, columns, (height, width), values
        # Far finer than any cube map in use: means of squares of pixels, by their area.
        while height % 2 == 0 and height > _EVEN_HEIGHT:
            z = np.sin(np.pi / 2 - np.arange(height + 1) / height * np.pi)
            area = (z[:-1] - z[1:])[:, None, None]
            base = (base * area).reshape(height // 2, 2, width // 2, 2, 3).sum(axis=(1, 3))
            height, width = height // 2, width // 2
            base = base / (2 * area.reshape(height, 2, 1, 1).sum(axis=1))
        rows, columns = np.divmod(np.arange(height * width), width)
        return (rows, columns, (height, width), base.reshape(-1, 3).astype(np.float32)), bright

    def sample(self, directions):
        """Radiance (m, 3) float32 of the pixels that `directions` (m, 3) fall into."""
        directions = expect_array("directions", directions, (None, 3), np.float64)
        u, v = equirectangular(directions)
        height, width = self.pixels.shape[:2]
        column = np.minimum((u * width).astype(np.int64), width - 1)
        row = np.minimum(((1 - v) * height).astype(np.int64), height - 1)
        return self.pixels[row, column]

    def interpolated(self, directions):
        """Radiance (m, 3) float32 along `directions` (m, 3), between the middles of pixels.

        Linear both ways, as Cycles shows an image.
        """
        directions = expect_array("directions", directions, (None, 3), np.float64)
        u, v = equirectangular(directions)
        height, width = self.pixels.shape[:2]
        across, down = u * width - 0.5, np.clip((1 - v) * height - 0.5, 0, height - 1)
        column, row = np.floor(across).astype(np.int64), np.floor(down).astype(np.int64)
        right = (across - column).astype(np.float32)[:, None]
        below = (down - row).astype(np.float32)[:, None]
        columns = column % width, (column + 1) % width
        upper, lower = (
            self.pixels[line, columns[0]] * (1 - right) + self.pixels[line, columns[1]] * right
            for line in (row, np.minimum(row + 1, height - 1))
        )
        return upper * (1 - below) + lower * below


def named_images(paths):
    """{name: EnvironmentMap} of images, by the names of their files."""
    good = isinstance(paths, list | tuple) and len(paths)
    expect(good, f"lights: expected a list of images or a dict of lights, got {shown(paths)}")
    lights = {}
    for path in paths:
        path = expect_path("lights", path)
        name = path.stem if path.stem not in lights else str(path)
        lights[name] = EnvironmentMap.read(path)
    return lights


def expect_radiance(name, light, cube_map):
    """Light on the texels of a cube map as (n_directions, 3) float32."""
    return expect_array(name, light, (cube_map.n_directions, 3), np.float32, 0, BRIGHTEST)


def expect_strength(name, light, strength):
    """Raise `PRTError` unless `strength` is a factor under which a light stays finite."""
    strength = expect_number("strength", strength, 0)
    brightest = float(light.max(initial=0))
    expect(
        brightest * strength <= BRIGHTEST,
        f"strength: {strength:g} times the brightest of {name}, {brightest:.4g}, is above "
        f"{BRIGHTEST:g}; expected less",
    )


def sums_on_texels(cube_map, matrix, rows, columns, shape, values, samples):
    """Power of pixels on each texel (n_directions, 3), and the solid angle that was covered."""
    height, width = shape
    n_directions = cube_map.n_directions
    parts = _parts_along(shape, n_directions, samples)
    # Parts of a pixel's height that have equal area: equal steps of z inside the pixel.
    edges = np.sin(np.pi / 2 - np.arange(height + 1) / height * np.pi)
    step = (edges[:-1] - edges[1:]) / parts
    inside = np.arange(parts) + 0.5
    z = edges[:-1] - step * inside[:, None]
    radius = np.sqrt(np.maximum(0, 1 - z * z))
    angle = np.pi - (np.arange(width)[:, None] + inside / parts) / width * 2 * np.pi
    tables = (z, radius, np.cos(angle), np.sin(angle))
    z, radius, cosine, sine = (table.astype(np.float32) for table in tables)
    matrix = matrix.astype(np.float32)
    share = (step * (2 * np.pi / (width * parts)))[rows]
    weights = [*(values.T * share), share]

    def some(first):
        part = slice(first, first + n_pixels)
        row, column = rows[part], columns[part]
        cosines, sines = cosine[column], sine[column]
        power = [np.repeat(weight[part], parts) for weight in weights]
        sums = np.zeros((4, n_directions))
        # One of the parts of each pixel's height after the other, all along its width at once.
        for level, ring in zip(z, radius, strict=True):
            up, out = level[row][:, None], ring[row][:, None]
            x, y = out * cosines, out * sines
            turned = ((m[0] * x + m[1] * y + m[2] * up).ravel() for m in matrix)
            texel = cube_map.texel_along(*turned)
            for total, weight in zip(sums, power, strict=True):
                total += np.bincount(texel, weight, n_directions)
        return sums

    n_pixels = max(1, _BAND // parts)
    total = sum(on_all_cores(some, range(0, len(rows), n_pixels)))
    return total[:3].T.copy(), total[3]


def pixel_parts(rows, columns, shape, n_directions, samples):
    """Parts of pixels, about `samples` for each of `n_directions` texels, of equal area in a pixel.

    Returns
    -------
    directions : (m, 3) float64
    areas : (m,) float64
    pixels : (m,) int
        Index of each part's pixel.
    """
    height, width = shape
    parts = _parts_along(shape, n_directions, samples)
    # Equal steps of z inside a pixel are equal areas.
    edges = np.sin(np.pi / 2 - np.arange(height + 1) / height * np.pi)
    step = (edges[:-1] - edges[1:]) / parts
    inside = np.arange(parts) + 0.5
    level = (edges[rows, None] - step[rows, None] * inside)[:, :, None]
    angle = np.pi - (columns[:, None] + inside / parts) / width * 2 * np.pi
    radius = np.sqrt(np.maximum(0, 1 - level * level))
    x, y = radius * np.cos(angle)[:, None], radius * np.sin(angle)[:, None]
    directions = np.stack([x, y, np.broadcast_to(level, x.shape)], axis=-1).reshape(-1, 3)
    areas = step * (2 * np.pi / (width * parts))
    pixels = np.repeat(np.arange(len(rows)), parts * parts)
    return directions, areas[rows][pixels], pixels


def _parts_along(shape, n_directions, samples):
    """Parts along each edge of a pixel."""
    wanted = n_directions * samples / (shape[0] * shape[1])
    return int(np.clip(np.ceil(np.sqrt(wanted)), 1, 4096))
