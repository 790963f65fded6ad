"""Environment maps: equirectangular images, and their light on the directions of a cube map."""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import PRTError, expect, expect_array
from prt_core.light.images import read_image
from prt_core.light.rotation import rotation_matrix

# Sub-samples a texel is averaged over, at least; more where an image's pixels are finer.
_SAMPLES_PER_TEXEL = 1000
_BAND = 1 << 20
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
    """

    pixels: np.ndarray
    name: str = "environment"

    def __post_init__(self):
        pixels = expect_array(f"{self.name}: pixels", self.pixels, (None, None, 3), np.float32)
        expect(pixels.size > 0, f"{self.name}: the image has no pixels")
        if pixels.min() < 0:
            raise PRTError(
                f"{self.name}: radiance expected >= 0, the smallest value is {pixels.min():.4g}"
            )
        self.pixels = pixels

    @classmethod
    def read(cls, path):
        """Read an .exr or .hdr image; anything but twice as wide as high is refused."""
        pixels = read_image(path)
        height, width = pixels.shape[:2]
        expect(
            width == 2 * height or (height == 1 and width == 1),
            f"{path}: an equirectangular image is twice as wide as high, got {width} x {height}",
        )
        lowest = float(pixels.min()) if pixels.size else 0.0
        # Negative radiance comes from resampling filters; a trace of it is cut, more is an error.
        if lowest < 0 and -lowest < 1e-2 * max(float(pixels.mean()), 1e-30):
            pixels = np.maximum(pixels, 0)
        return cls(pixels, str(path))

    def to_cube_map(self, cube_map, rotation=None, strength=1.0):
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

        Returns
        -------
        (n_directions, 3) float32
        """
        expect(
            np.isfinite(strength) and strength >= 0,
            f"strength: expected a finite number >= 0, got {strength}",
        )
        matrix = rotation_matrix(rotation)
        height, width = self.pixels.shape[:2]
        wanted = cube_map.n_directions * _SAMPLES_PER_TEXEL / (height * width)
        parts = int(np.clip(np.ceil(np.sqrt(wanted)), 1, 4096))
        n_directions = cube_map.n_directions
        base = np.minimum(self.pixels, _BRIGHT * self.pixels.mean(axis=(0, 1), dtype=np.float64))
        layers = np.concatenate([base, self.pixels - base], axis=-1)
        used = np.flatnonzero(layers.any(axis=(0, 1)))
        layers = layers[:, :, used]
        sums, covered = np.zeros((n_directions, 6)), np.zeros(n_directions)
        columns = -(np.arange(width * parts) + 0.5) / (width * parts) * 2 * np.pi + np.pi
        cosine, sine = np.cos(columns), np.sin(columns)
        rows_at_once = max(1, _BAND // (width * parts))
        # Parts of a pixel's height that have equal area: equal steps of z inside the pixel.
        top = np.sin(np.pi / 2 - np.arange(height) / height * np.pi)
        bottom = np.sin(np.pi / 2 - (np.arange(height) + 1) / height * np.pi)
        step = (top - bottom) / parts
        z = (top[:, None] - step[:, None] * (np.arange(parts) + 0.5)).ravel()
        area = np.repeat(step, parts) * (2 * np.pi / (width * parts))
        for first in range(0, height * parts, rows_at_once):
            band = slice(first, min(first + rows_at_once, height * parts))
            level = z[band, None]
            radius = np.sqrt(np.maximum(0, 1 - level * level))
            shape = (len(level), width * parts)
            directions = np.stack(
                [radius * cosine, radius * sine, np.broadcast_to(level, shape)], axis=-1
            ).reshape(-1, 3)
            texel = cube_map.texel_of(directions @ matrix.T)
            rows = np.arange(band.start, band.stop) // parts
            share = np.repeat(area[band], width * parts)
            covered += np.bincount(texel, share, n_directions)
            for channel, layer in zip(used, np.moveaxis(layers, -1, 0), strict=True):
                values = np.repeat(layer[rows], parts, axis=1).ravel() * share
                sums[:, channel] += np.bincount(texel, values, n_directions)
        even = sums[:, :3] / np.maximum(covered, 1e-30)[:, None]
        bright = sums[:, 3:] / cube_map.solid_angles[:, None]
        return ((even + bright) * strength).astype(np.float32)

    def sample(self, directions):
        """Radiance (m, 3) float32 of the pixel each direction falls into."""
        u, v = equirectangular(np.asarray(directions, np.float64))
        height, width = self.pixels.shape[:2]
        column = np.minimum((u * width).astype(np.int64), width - 1)
        row = np.minimum(((1 - v) * height).astype(np.int64), height - 1)
        return self.pixels[row, column]
