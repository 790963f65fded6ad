"""Image textures anywhere on a mesh: what `Mesh.paint` is where Blender's materials have images."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from prt_core.blender.images import pixels_of


@dataclass(frozen=True, eq=False)
class Picture:
    """The colours of an image, kept once for all that show it.

    Attributes
    ----------
    pixels : (height, width, 3) float16 or float32
        Linear, first row on top; eight bits of the image need no more than half precision.
    """

    pixels: np.ndarray

    @classmethod
    def of(cls, image, known):
        """That of a Blender image, from `known` where it was read before."""
        if image.session_uid not in known:
            pixels = pixels_of(image)[..., :3]
            exact = image.is_float or pixels.max(initial=0) > 1
            known[image.session_uid] = cls(pixels.astype(np.float32 if exact else np.float16))
        return known[image.session_uid]

    @cached_property
    def digest(self):
        """bytes that tell equal pixels from others."""
        return hashlib.blake2b(np.ascontiguousarray(self.pixels), digest_size=16).digest()


@dataclass(frozen=True, eq=False)
class Texture:
    """An image laid on a mesh.

    Attributes
    ----------
    picture : Picture
    uv : (n_corners, 2) float32
        Of all corners of the mesh.
    interpolation, extension : str
        As the node has them.
    factor : float
        On its colours.
    """

    picture: Picture
    uv: np.ndarray
    interpolation: str
    extension: str
    factor: float = 1.0

    def at(self, uv):
        """(m, 3) float64 colours at places (m, 2) of the image."""
        pixels, (height, width) = self.picture.pixels, self.picture.pixels.shape[:2]
        position = np.asarray(uv, np.float64) * [width, height] - 0.5
        if self.interpolation == "Closest":
            position = np.floor(position + 0.5)
        first = np.floor(position).astype(np.int64)
        share = position - first
        result = np.zeros((len(uv), 3))
        for dx in (0, 1):
            for dy in (0, 1):
                x, y = first[:, 0] + dx, first[:, 1] + dy
                if self.extension == "REPEAT":
                    x, y = x % width, y % height
                elif self.extension == "MIRROR":
                    x, y = (
                        np.minimum(k % (2 * n), 2 * n - 1 - k % (2 * n))
                        for k, n in ((x, width), (y, height))
                    )
                inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
                x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
                weight = np.abs(1 - dx - share[:, 0]) * np.abs(1 - dy - share[:, 1])
                if self.extension == "CLIP":
                    weight = weight * inside
                result += weight[:, None] * pixels[height - 1 - y, x]
        return result * self.factor


class TexturePaint:
    """The `Paint` of a mesh some of whose materials have an image.

    Parameters
    ----------
    corner_slot : (n_corners,) int
    corner_albedo : (n_corners, 3) float64
        Of all materials; what lies between corners without an image.
    textures : dict of int -> Texture
        By material slot.
    """

    def __init__(self, corner_slot, corner_albedo, textures):
        self._slot, self._albedo, self._textures = corner_slot, corner_albedo, textures

    def at(self, corners, weights):
        """See `Paint`."""
        result = np.einsum("mk,mkc->mc", weights, self._albedo[corners])
        slot = self._slot[corners[:, 0]]
        for number, texture in self._textures.items():
            mine = np.flatnonzero(slot == number)
            uv = np.einsum("mk,mkx->mx", weights[mine], texture.uv[corners[mine]])
            result[mine] = texture.at(uv)
        return {"albedo": np.nan_to_num(result)}

    def texels(self, corners):
        """See `Paint`."""
        result = np.zeros(len(corners))
        slot = self._slot[corners[:, 0]]
        for number, texture in self._textures.items():
            mine = slot == number
            a, b, c = np.moveaxis(texture.uv[corners[mine]].astype(np.float64), 1, 0)
            (bx, by), (cx, cy) = (b - a).T, (c - a).T
            height, width = texture.picture.pixels.shape[:2]
            result[mine] = np.abs(bx * cy - by * cx) / 2 * width * height
        return result

    def digest(self):
        """See `Paint`."""
        digest = hashlib.blake2b(self._slot.astype(np.int64).tobytes(), digest_size=16)
        for number, texture in sorted(self._textures.items()):
            digest.update(texture.picture.digest + np.ascontiguousarray(texture.uv).tobytes())
            settings = number, texture.interpolation, texture.extension, texture.factor
            digest.update(repr(settings).encode())
        return digest.digest()
