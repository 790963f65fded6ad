"""Rows of the pixels of a camera's image with their gloss: radiance towards that camera."""

import numpy as np
import scipy.sparse as sp

from prt_core.compress.rows.image_rows import ImageRows
from prt_core.errors import expect_kind
from prt_core.reflectance import QUANTITIES
from prt_core.runtime.machine import expect_memory
from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress, run
from prt_core.transport.view_weights import ViewWeights

# Points of pixels worked on at once, and bake points whose rows they send on.
_TOGETHER, _RECEIVING = 128, 256
# What small features add up to that are left out, in parts of all of a row.
_SPARED = 2e-3
# Bytes of a pixel's features, about: one of six is kept.
_BYTES = 0.7


class ViewRows(ImageRows):
    """What pixels show with gloss, for unit radiance from each texel of the sky.

    As `ImageRows`, but what a pixel's points send is not what they receive times an albedo: the
    lobes of their own add texels that they see, and what other points send that they see. Features
    are dear, so they are worked out once, and kept.

    Parameters
    ----------
    rows : TransportRows
        Of all points.
    image : PointImage
    weights : ViewWeights
        Of the points of the image, towards the camera.
    """

    def __init__(self, rows, image, weights):
        self._weights = expect_kind("weights", weights, ViewWeights)
        super().__init__(rows, image, rows.transport.materials.front)
        self._kept = None

    def _is_grey(self):
        materials = self.rows.transport.materials
        names = [n for n, q in QUANTITIES.items() if q.n_channels == 3]
        colours = [getattr(materials, n) for n in names if n not in ("emission", "tangent")]
        return all((colour == colour[:, :1]).all() for colour in colours)

    def prepare_steps(self):
        """Work out the features of all pixels; a generator of `Progress`."""
        if self._kept is not None:
            return self
        expect_memory(
            f"image of {self.image.width} x {self.image.height} pixels with gloss",
            _BYTES * self.n_points * self.n_directions * (1 if self._grey else 3),
            "take fewer pixels, or a lower resolution",
        )
        yield from super().prepare_steps()
        step = max(1, _TOGETHER // self.image.samples)
        parts = [
            np.arange(first, min(first + step, self.n_points))
            for first in range(0, self.n_points, step)
        ]
        kept, done = [], 0
        for part, features in zip(parts, in_parallel(self._sparse, parts), strict=True):
            kept.append(features)
            done += len(part)
            yield Progress("view", done, self.n_points)
        self._kept = sp.vstack(kept, format="csr")
        return self

    def features(self, points):
        """See `Rows.features`."""
        if self._kept is None:
            run(self.prepare_steps())
        return self._kept[points].toarray()

    def product(self, light):
        """What these rows give, of which nothing is compressed.

        Parameters
        ----------
        light : (n_directions, 3) float32

        Returns
        -------
        (n_pixels, 3) float32
        """
        coded = self.code.light(light)

        def one(points):
            return self.code.products(self.features(points), coded)

        return np.concatenate(list(in_parallel(one, self.blocks()))).astype(np.float32)

    def _sparse(self, pixels):
        features = self._features(pixels)
        least = _SPARED * np.linalg.norm(features, axis=1) / np.sqrt(features.shape[1])
        features[np.abs(features) < least[:, None]] = 0
        return sp.csr_matrix(features)

    def _features(self, pixels):
        pixel, entries = self._entries(pixels)
        result = np.zeros((len(pixels), self.code.n_features), np.float32)
        if not len(entries):
            return result
        weights = self._weights.of(self.image.point[entries])
        texels = np.zeros((len(pixels), 3, self.n_directions), np.float32)
        first = np.flatnonzero(np.diff(pixel, prepend=-1))
        texels[pixel[first]] = np.add.reduceat(weights.texels, first, axis=0)
        shown, place = np.unique(weights.point, return_inverse=True)
        row, received = pixel[weights.row], weights.received
        self._add_direct(texels, row, place, received, shown)
        texels /= np.float32(self.image.samples)
        indirect = self.rows.indirect(shown)
        shape = len(pixels), len(shown)
        for (part, shares, group), own in zip(self._groups, self.code.slices, strict=True):
            if group.direct:
                mixed = np.tensordot(texels, (shares * 3**0.5).astype(np.float32), (1, 0))
                result[:, own] = self.code.code(mixed)
                continue
            by = received @ (shares / self.image.samples).astype(np.float32)
            left = indirect[self.rows.code.slices.index(part) - 1]
            result[:, own] = sp.csr_matrix((by, (row, place)), shape=shape) @ left
        return result

    def _add_direct(self, texels, row, place, received, shown):
        """Light of the sky that points `shown` send on, which has come straight to them."""
        channels = [0] if self._grey else [0, 1, 2]
        for first in range(0, len(shown), _RECEIVING):
            some = shown[first : first + _RECEIVING]
            mine = np.flatnonzero((place >= first) & (place < first + len(some)))
            direct = self.rows.direct(some)
            for channel in channels:
                where = row[mine], place[mine] - first
                shape = len(texels), len(some)
                texels[:, channel] += (
                    sp.csr_matrix((received[mine, channel], where), shape=shape) @ direct
                )
