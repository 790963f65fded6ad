"""The light of a scene's world as a bake keeps it: on its texels, and as an image for gloss."""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect_kind
from prt_core.light.environment import EnvironmentMap
from prt_core.light.sky import Sky, coarser
from prt_core.sphere import rotation_matrix

# Rows of the image at most, and at once.
_ROWS, _BAND = 512, 64


@dataclass(frozen=True, eq=False)
class BakedWorld:
    """A world's light.

    Attributes
    ----------
    texels : (n_directions, 3) float32
        On the directions of a bake, with the suns that are lamps.
    image : EnvironmentMap, or None
        The same in finer detail, without those suns, for what mirrors it.
    """

    texels: np.ndarray
    image: EnvironmentMap | None = None


def image_of_world(environment, rotation=None, strength=1.0):
    """A world as one image, which needs no turning.

    Parameters
    ----------
    environment : EnvironmentMap
    rotation : see `rotation_matrix`
    strength : float

    Returns
    -------
    EnvironmentMap
        Of at most 512 rows, whose pixels are means of those that they replace; of one pixel where
        the world is even.
    """
    expect_kind("environment", environment, EnvironmentMap)
    pixels, matrix = environment.pixels, rotation_matrix(rotation)
    if (pixels == pixels[0, 0]).all():
        return EnvironmentMap(pixels[:1, :1] * np.float32(strength), "world")
    height = min(_ROWS, len(pixels))
    if height == len(pixels) and np.array_equal(matrix, np.eye(3)):
        return EnvironmentMap(pixels * np.float32(strength), "world")
    sky, bands = Sky(((coarser(environment, np.pi / height), matrix, strength),)), []
    turn = (0.5 - (np.arange(2 * height) + 0.5) / (2 * height)) * 2 * np.pi
    for first in range(0, height, _BAND):
        rows = np.arange(first, min(first + _BAND, height))
        rise = (0.5 - (rows + 0.5) / height) * np.pi
        up, around = (each.ravel() for each in np.meshgrid(rise, turn, indexing="ij"))
        level = np.cos(up)
        ways = np.stack([level * np.cos(around), level * np.sin(around), np.sin(up)], axis=1)
        bands.append(sky(ways).reshape(len(rows), -1, 3))
    return EnvironmentMap(np.concatenate(bands), "world")
