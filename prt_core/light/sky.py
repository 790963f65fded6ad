"""What is seen behind a scene: the images of its light, turned, dimmed, and filtered for pixels."""

from dataclasses import dataclass, replace

import numpy as np

from prt_core.errors import expect_array, expect_number

# Radius in radians that a sun's disc has at least.
_LEAST_SUN = np.radians(0.25)


@dataclass(frozen=True)
class Sky:
    """The sum of images of far light, as a function of directions.

    Attributes
    ----------
    parts : tuple of (EnvironmentMap, (3, 3) float, float)
        An image, the matrix that turns it, and a factor.
    """

    parts: tuple

    def __call__(self, directions, spread=0.0):
        """Radiance along directions.

        Parameters
        ----------
        directions : (m, 3) float
        spread : float
            Radians between one of them and the next: of what is finer in an image the mean is
            seen.

        Returns
        -------
        (m, 3) float32
            Linear Rec.709.
        """
        directions = expect_array("directions", directions, (None, 3), np.float64)
        expect_number("spread", spread, 0, 2 * np.pi)
        total = np.zeros(directions.shape, np.float32)
        for image, matrix, factor in self.parts:
            seen = coarser(image, spread).interpolated(directions @ matrix)
            total += seen * np.float32(factor)
        return total

    def scaled(self, factor):
        """The same `Sky`, but brighter.

        Parameters
        ----------
        factor : float
            How many times as bright it is.
        """
        return Sky(tuple((image, matrix, part * factor) for image, matrix, part in self.parts))

    def __add__(self, other):
        return Sky((*self.parts, *other.parts))


def with_suns(sky, suns):
    """A sky with discs of suns, as a function of (m, 3) directions to (m, 3) float32.

    Parameters
    ----------
    sky : Sky, or None
        None stays None.
    suns : sequence of ((3,) float, (3,) float, float)
        Unit vectors towards each, what it brings to a surface that faces it, and its diameter in
        radians; narrower ones than half a degree are as wide as that.
    """
    if sky is None or not suns:
        return sky

    def shown(directions):
        total = sky(directions)
        for towards, irradiance, angle in suns:
            half = max(angle / 2, _LEAST_SUN)
            inside = directions @ towards > np.cos(half)
            total[inside] += np.float32(irradiance / (np.pi * np.sin(half) ** 2))
        return total

    return shown


def coarser(image, spread):
    """An `EnvironmentMap` whose pixels are about as wide as `spread` in radians.

    They are means of blocks of those of the image, which is returned where they would be its own.

    Parameters
    ----------
    image : EnvironmentMap
    spread : float
    """
    height, width = image.pixels.shape[:2]
    side = min(int(spread / (2 * np.pi / width)), height)
    while side > 1 and (height % side or width % side):
        side -= 1
    if side <= 1:
        return image
    blocks = image.pixels.reshape(height // side, side, width // side, side, -1)
    return replace(image, pixels=blocks.mean(axis=(1, 3)))
