"""Rows of the pixels of an image whose points were baked."""

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from prt_core.compress.rows.rows import Rows
from prt_core.compress.wavelets.haar_lighting import OPPONENTS
from prt_core.errors import expect, expect_array
from prt_core.transport.sent import Sent


class ImageRows(Rows):
    """The mean of the points of each pixel, albedo included; black pixels are rows of zeros.

    Features are means of the points' features, which are thinner than rows. What is the same in
    several channels of the points' rows need not be so for a pixel, whose points differ in albedo:
    each group of theirs is one for luminance here and two for differences of channels.

    Parameters
    ----------
    rows : Rows
        Of all points.
    image : PointImage
    albedo : (n_points, n_outputs) float32
        Of all points: a pixel shows several, so that theirs is part of its row.
    """

    def __init__(self, rows, image, albedo):
        expect(image is not None, "image: the bake holds none")
        self.rows, self.image = rows, image
        self.n_points, self.n_directions = image.height * image.width, rows.n_directions
        self.n_outputs, self.reads, self.resolution = rows.n_outputs, rows.reads, rows.resolution
        self._starts = np.searchsorted(image.pixel, np.arange(self.n_points + 1))
        shape = rows.n_points, rows.n_outputs
        self._albedo = expect_array("albedo", albedo, shape, np.float32)
        self._grey = self._is_grey()

    def _is_grey(self):
        return bool((self._albedo == self._albedo[:, :1]).all())

    def prepare_steps(self):
        """See `TransportRows.prepare_steps`."""
        if hasattr(self.rows, "prepare_steps"):
            yield from self.rows.prepare_steps()
        return self

    @cached_property
    def _groups(self):
        """Of each group: a slice of the points' features, shares of their albedo, the group."""
        groups = []
        mixed = OPPONENTS if self.n_outputs == 3 else np.eye(self.n_outputs)
        for group, part in zip(self.rows.code.groups, self.rows.code.slices, strict=True):
            if self._grey:
                groups.append((part, np.eye(self.n_outputs)[0], group))
                continue
            for shares in mixed:
                groups.append((part, shares * group.shares, replace(group, shares=tuple(shares))))
        return groups

    @cached_property
    def code(self):
        return replace(self.rows.code, groups=tuple(group for *_, group in self._groups))

    def features(self, points):
        pixel, entries = self._entries(points)
        result = np.zeros((len(points), self.code.n_features), np.float32)
        if not len(entries):
            return result
        shown, place = np.unique(self.image.point[entries], return_inverse=True)
        features = self.rows.features(shown)
        shape = len(points), len(shown)
        for (part, shares, _), own in zip(self._groups, self.code.slices, strict=True):
            weights = self._albedo[shown[place]] @ (shares / self.image.samples).astype(np.float32)
            result[:, own] = (
                sp.csr_matrix((weights, (pixel, place)), shape=shape) @ features[:, part]
            )
        return result

    def _entries(self, points):
        """(m,) which of the pixels, and (m,) the entry of the image, of all that they show."""
        starts, counts = self._starts[points], np.diff(self._starts)[points]
        ends = np.cumsum(counts)
        entries = np.arange(counts.sum()) + np.repeat(starts - ends + counts, counts)
        return np.repeat(np.arange(len(points)), counts), entries

    def block(self, points):
        return self.code.decode(self.features(points))


def image_rows(rows, image, sends):
    """`ImageRows` of what points send of what they receive: albedo, or `Sent`.

    Parameters
    ----------
    rows : Rows
        Of all points.
    image : PointImage
    sends : (n_points, n_outputs) float32, or Sent
        Points behind those that a pixel shows are shown by it as well, by the translucency.

    Returns
    -------
    ImageRows
    """
    if image is None or not isinstance(sends, Sent):
        return ImageRows(rows, image, sends)
    behind = sends.opposite[image.point]
    has = behind >= 0
    weights = sends.albedo.copy()
    weights[behind[has]] = sends.translucency[image.point[has]]
    pixel = np.concatenate([image.pixel, image.pixel[has]])
    point = np.concatenate([image.point, behind[has]])
    order = np.argsort(pixel, kind="stable")
    both = replace(image, pixel=pixel[order], point=point[order])
    return ImageRows(rows, both, weights)
