"""The sun of an environment map, taken out of it: its shadows need rays, not texels.

A texel has one traced direction, which displaces a shadow by up to half a texel at any resolution.
So what pixels have above fifty times the mean is sampled by its power, like a lamp.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_array, expect_kind, expect_numbers, expect_pair
from prt_core.light.environment import EnvironmentMap, expect_strength
from prt_core.sphere import rotation_matrix

# A pixel is part of a sun when it is so many times brighter than the mean of the map.
_TIMES_MEAN = 50.0
_MOST_SIDE = 1 << 20


@dataclass
class BrightPixels:
    """Small bright parts of an environment, sampled by their power like a lamp.

    Attributes
    ----------
    rows, columns : (n,) int
        The pixels.
    shape : (int, int)
        Height and width of the map.
    radiance : (n, 3) float64
        What each pixel has above the rest of the map.
    rotation : (3, 3) float64
        Of the environment.
    name, kind : str
        As those of a `Lamp`.
    """

    rows: np.ndarray
    columns: np.ndarray
    shape: tuple
    radiance: np.ndarray
    rotation: np.ndarray
    name: str = "bright pixels"
    kind: str = "pixels"

    # As those of a `Lamp`: everything receives, and everything is in the way.
    receivers = blockers = None
    casts_shadow, of_world, highlights = True, False, True

    def __post_init__(self):
        n = expect_numbers("rows", self.rows).size
        expect(n > 0, "bright pixels: expected at least one")
        height, width = self.shape = expect_pair("shape", self.shape, 1, _MOST_SIDE)
        for name, most in (("rows", height), ("columns", width)):
            array = expect_array(name, getattr(self, name), (n,), np.int64, 0, most - 1)
            setattr(self, name, array)
        self.radiance = expect_array("radiance", self.radiance, (n, 3), np.float64, 0)
        expect((self.radiance > 0).any(axis=1).all(), "radiance: expected light in every pixel")
        self.rotation = rotation_matrix(self.rotation)
        edges = np.sin(np.pi / 2 - np.arange(self.shape[0] + 1) / self.shape[0] * np.pi)
        self._top, self._bottom = edges[self.rows], edges[self.rows + 1]
        area = (self._top - self._bottom) * 2 * np.pi / self.shape[1]
        power = self.radiance.sum(axis=1) * area
        self.power = (self.radiance * area[:, None]).sum(axis=0)
        self._share = power / power.sum()
        self._cumulative = np.cumsum(self._share)
        # Radiance over density: the density of a pixel is its share over its area.
        self._weight = self.radiance * (area / self._share)[:, None]

    @property
    def is_small(self):
        """Whether one sample is enough: never."""
        return False

    def seen_from(self, positions):
        """As `Lamp.seen_from`: towards the middle of their power, as wide as that is spread."""
        z = (self._top + self._bottom) / 2
        angle = np.pi - 2 * np.pi * (self.columns + 0.5) / self.shape[1]
        radius = np.sqrt(np.maximum(0, 1 - z * z))
        ways = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
        middle = self._share @ ways
        length = np.linalg.norm(middle)
        area = (self._top - self._bottom) * 2 * np.pi / self.shape[1]
        # The length of a mean of directions tells how far they are spread.
        spread = np.arccos(np.clip(2 * length - 1, -1, 1)) if length > 0 else np.pi
        width = max(spread, float(np.sqrt((self._share @ area) / np.pi)))
        middle = middle / length if length > 1e-9 else np.array([0, 0, 1.0])
        directions = np.broadcast_to(self.rotation @ middle, np.shape(positions))
        return directions, np.full(len(positions), width)

    def sample(self, positions, uv):
        """As `Lamp.sample`: direction, distance, irradiance for each point."""
        u = np.minimum(uv[:, 0], 1 - 1e-9)
        pixel = np.minimum(np.searchsorted(self._cumulative, u, side="right"), len(self.rows) - 1)
        before = self._cumulative[pixel] - self._share[pixel]
        inside = np.clip((u - before) / self._share[pixel], 0, 1)
        z = self._bottom[pixel] + uv[:, 1] * (self._top - self._bottom)[pixel]
        angle = np.pi - 2 * np.pi * (self.columns[pixel] + inside) / self.shape[1]
        radius = np.sqrt(np.maximum(0, 1 - z * z))
        direction = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
        direction = direction @ self.rotation.T
        return direction, np.full(len(positions), np.inf), self._weight[pixel]


def split_sun(environment, rotation=None, strength=1.0):
    """An environment without its sun, and the sun.

    Parameters
    ----------
    environment : EnvironmentMap
    rotation : see `rotation_matrix`
    strength : float

    Returns
    -------
    rest : EnvironmentMap
        To be put on the cube map with the same rotation and strength.
    sun : BrightPixels or None
        None where no pixel is much brighter than the others.
    """
    expect_kind("environment", environment, EnvironmentMap)
    expect_strength(environment.name, environment.pixels, strength)
    turn = rotation_matrix(rotation)
    pixels = environment.pixels
    height, width = pixels.shape[:2]
    z = np.sin(np.pi / 2 - np.arange(height + 1) / height * np.pi)
    weights = (z[:-1] - z[1:]) / 2
    mean = (pixels.mean(axis=(1, 2), dtype=np.float64) * weights).sum()
    limit = _TIMES_MEAN * mean
    bright = pixels.max(axis=-1) > limit
    if not bright.any() or strength == 0:
        return environment, None
    rest = pixels.copy()
    rest[bright] *= (limit / pixels[bright].max(axis=-1, keepdims=True)).astype(np.float32)
    rows, columns = np.nonzero(bright)
    above = np.maximum(pixels[bright].astype(np.float64) - rest[bright], 0) * strength
    # Rounding leaves nothing of those that are hardly above.
    bright_rows = above.any(axis=1)
    if not bright_rows.any():
        return environment, None
    sun = BrightPixels(
        rows[bright_rows], columns[bright_rows], (height, width), above[bright_rows], turn
    )
    return EnvironmentMap(rest, environment.name, environment.notes), sun
