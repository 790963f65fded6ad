"""What a point sends of what it and its back receive: A of B = A (E + K B)."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sent:
    """Light of the front leaves by the albedo, light of the back by the translucency.

    Attributes
    ----------
    albedo, translucency : (n_points, n_channels) float32
    opposite : (n_points,) int32
        The point on the other side of the same place, whose opposite is this one; -1 where there
        is none.
    """

    albedo: np.ndarray
    translucency: np.ndarray
    opposite: np.ndarray

    def __call__(self, received):
        """(n_points, ..., n_channels) of what is received, of the same shape."""
        front, through = self._shaped(received)
        return front * received + through * self._behind(received)

    def adjoint(self, weights):
        """The transposed map: how much received light adds to weighted sums of what is sent."""
        front, through = self._shaped(weights)
        return front * weights + self._behind(through * weights)

    def __getitem__(self, points):
        """That of some points, (n,) int ascending, with opposites among them."""
        numbers = np.full(len(self.opposite) + 1, -1, np.int32)
        numbers[points] = np.arange(len(points))
        return Sent(self.albedo[points], self.translucency[points],
                    numbers[self.opposite[points]])  # fmt: skip

    def _shaped(self, values):
        between = (1,) * (values.ndim - 2)
        return (x.reshape(len(x), *between, -1) for x in (self.albedo, self.translucency))

    def _behind(self, values):
        behind = values[self.opposite]
        behind[self.opposite < 0] = 0
        return behind


def sent_of(materials, opposite):
    """`Sent` of `Materials` and opposites; the albedo alone where nothing shines through."""
    if opposite is None or not materials.through.any():
        return materials.front
    return Sent(materials.front, materials.through, opposite)


def of_channels(sends, channels):
    """Albedo, or `Sent`, of some channels."""
    if isinstance(sends, Sent):
        parts = sends.albedo[:, channels], sends.translucency[:, channels]
        return Sent(*parts, sends.opposite)
    return sends[:, channels]


def mean_of_channels(sends):
    """Albedo, or `Sent`, (n_points, 1), of the mean of the channels."""
    if isinstance(sends, Sent):
        parts = (x.mean(axis=1, keepdims=True) for x in (sends.albedo, sends.translucency))
        return Sent(*parts, sends.opposite)
    return sends.mean(axis=1, keepdims=True)
