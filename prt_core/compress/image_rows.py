"""Rows of the pixels of an image whose points were baked."""

import numpy as np
import scipy.sparse as sp

from prt_core.compress.rows import Rows
from prt_core.errors import expect


class ImageRows(Rows):
    """The mean of the points of each pixel, albedo included; black pixels are rows of zeros.

    Parameters
    ----------
    rows : Rows
        Of all points.
    image : PointImage
    """

    def __init__(self, rows, image):
        expect(image is not None, "image: the bake holds none")
        self.rows, self.image = rows, image
        self.n_points, self.n_directions = image.height * image.width, rows.n_directions
        self.n_channels, self.resolution = rows.n_channels, rows.resolution
        self._starts = np.searchsorted(image.pixel, np.arange(self.n_points + 1))

    def prepare_steps(self):
        """See `TransportRows.prepare_steps`."""
        if hasattr(self.rows, "prepare_steps"):
            yield from self.rows.prepare_steps()
        return self

    def block(self, points):
        starts, counts = self._starts[points], np.diff(self._starts)[points]
        ends = np.cumsum(counts)
        entries = np.arange(ends[-1] if len(ends) else 0) + np.repeat(
            starts - ends + counts, counts
        )
        shown, place = np.unique(self.image.point[entries], return_inverse=True)
        result = np.zeros((len(points), self.n_directions, self.n_channels), np.float32)
        if not len(shown):
            return result
        made = self.rows.block(shown)
        if self.rows.gain is not None:
            made = made * self.rows.gain[shown, None]
        pixel = np.repeat(np.arange(len(points)), counts)
        share = np.full(len(entries), 1 / self.image.samples, np.float32)
        mean = sp.csr_matrix((share, (pixel, place)), shape=(len(points), len(shown)))
        return (mean @ made.reshape(len(shown), -1)).reshape(result.shape)
