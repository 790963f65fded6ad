"""Phong's lobe about the mirror direction, scaled so that it keeps energy."""

import numpy as np

from prt_core.reflectance.arrays import (
    both_above,
    expect_both,
    expect_colour,
    expect_parameter,
    expect_viewed,
    in_type_of,
)
from prt_core.sphere import square_to_cosine_power, tangents


class Phong:
    """(n + 2) / 2 pi times the cosine with the mirror direction to the power n.

    All light of a white lobe leaves where it is seen from straight on, less at other angles. It is
    reciprocal. A surface that is diffuse as well is a `Sum` of this and `Lambert`.

    Parameters
    ----------
    exponent : float or (...) array_like
        0 or more.
    reflectance : float or (..., n_channels) array_like

    Source: Lafortune and Willems 1994, Using the modified Phong reflectance model.
    """

    def __init__(self, exponent, reflectance=1.0):
        self.exponent = expect_parameter("exponent", exponent, 0)
        self.reflectance = expect_colour("reflectance", reflectance)

    @property
    def n_channels(self):
        """Of the reflectance."""
        return self.reflectance.shape[-1]

    @property
    def roughness(self):
        """(...) slider of a GGX lobe that is as wide near its peak."""
        # Half vectors turn by half the angle: their exponent is four times as large.
        return (4 / (4 * self.exponent + 4)) ** 0.25

    def eval(self, incoming, outgoing):
        """See `Reflectance.eval`."""
        incoming, outgoing = expect_both(
            incoming, outgoing, self.exponent, self.reflectance[..., 0]
        )
        colour, exponent = in_type_of(incoming, self.reflectance / (2 * np.pi), self.exponent)
        value = (exponent + 2) * self._lobe(incoming, outgoing, exponent)
        value = np.where(both_above(incoming, outgoing), value, 0)
        return value[..., None] * colour

    def sample(self, outgoing, uv):
        """See `Reflectance.sample`; what falls below the horizon has no reflectance."""
        outgoing, uv = expect_viewed(outgoing, uv, self.exponent, self.reflectance[..., 0])
        (exponent,) = in_type_of(outgoing, self.exponent)
        local = square_to_cosine_power(uv, exponent)
        mirror = outgoing * np.array([-1, -1, 1], outgoing.dtype)
        x, y = (t.reshape(mirror.shape) for t in tangents(mirror.reshape(-1, 3)))
        turned = local[..., :1] * x + local[..., 1:2] * y + local[..., 2:] * mirror
        return turned.astype(outgoing.dtype)

    def pdf(self, incoming, outgoing):
        """See `Reflectance.pdf`."""
        incoming, outgoing = expect_both(
            incoming, outgoing, self.exponent, self.reflectance[..., 0]
        )
        (exponent,) = in_type_of(incoming, self.exponent)
        norm = (exponent + 1) / incoming.dtype.type(2 * np.pi)
        return norm * self._lobe(incoming, outgoing, exponent)

    @staticmethod
    def _lobe(incoming, outgoing, exponent):
        x, y = (incoming[..., k] + outgoing[..., k] for k in range(2))
        z = incoming[..., 2] - outgoing[..., 2]
        # One minus the cosine, from the distance to the mirror direction: exact in narrow lobes.
        short = (x * x + y * y + z * z) / 2
        return np.where(
            short < 1, np.exp(exponent * np.log1p(-np.minimum(short, 1 - 1e-7))), 0
        ).astype(incoming.dtype)
