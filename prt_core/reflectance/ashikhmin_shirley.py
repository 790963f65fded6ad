"""Ashikhmin and Shirley's anisotropic Phong model: a specular lobe, and a diffuse one below."""

import numpy as np

from prt_core.reflectance.arrays import (
    both_above,
    expect_both,
    expect_colour,
    expect_parameter,
    expect_viewed,
    in_type_of,
    mirrored,
)
from prt_core.sphere import (
    cosine_density,
    cosine_power,
    cosine_power_density,
    square_to_cosine,
    square_to_cosine_power,
)


class AshikhminShirley:
    """The specular lobe, with Schlick's Fresnel term.

    Parameters
    ----------
    exponent_x, exponent_y : float or (...) array_like
        Along the tangent and across it, 0 or more. Cycles has 2 / alpha^2 - 2.
    reflectance : float or (..., n_channels) array_like
        Seen from straight on, 0 to 1. With 1 there is no Fresnel term, as in Cycles.

    Source: Ashikhmin and Shirley 2000, An anisotropic Phong BRDF model, equation 4.
    """

    def __init__(self, exponent_x, exponent_y, reflectance=1.0):
        self.exponent_x = expect_parameter("exponent_x", exponent_x, 0)
        self.exponent_y = expect_parameter("exponent_y", exponent_y, 0)
        self.reflectance = expect_colour("reflectance", reflectance, 1)
        # What has to fit the directions.
        self._each = self.exponent_x, self.exponent_y, self.reflectance[..., 0]

    @property
    def n_channels(self):
        """Of the reflectance."""
        return self.reflectance.shape[-1]

    @property
    def roughness(self):
        """(...) slider of a GGX lobe that is as wide near its peak, where it is narrowest."""
        return (4 / (np.maximum(self.exponent_x, self.exponent_y) + 4)) ** 0.25

    def eval(self, incoming, outgoing):
        """See `Reflectance.eval`."""
        incoming, outgoing = expect_both(incoming, outgoing, *self._each)
        x, y, f0 = in_type_of(incoming, self.exponent_x, self.exponent_y, self.reflectance)
        half, cosine = _half(incoming, outgoing)
        highest = np.maximum(incoming[..., 2], outgoing[..., 2])
        tiny = np.finfo(incoming.dtype).tiny
        value = cosine_power(half, x, y) * np.sqrt((x + 1) * (y + 1))
        value = value / (8 * np.pi * np.maximum(cosine * highest, tiny))
        value = np.where(both_above(incoming, outgoing), value, 0).astype(incoming.dtype)
        fresnel = f0 + (1 - f0) * ((1 - cosine) ** 5)[..., None]
        return value[..., None] * fresnel

    def sample(self, outgoing, uv):
        """See `Reflectance.sample`; what falls below the horizon has no reflectance."""
        outgoing, uv = expect_viewed(outgoing, uv, *self._each)
        return mirrored(outgoing, square_to_cosine_power(uv, self.exponent_x, self.exponent_y))

    def pdf(self, incoming, outgoing):
        """See `Reflectance.pdf`.

        Half vectors are drawn whether the viewer sees them or not; those behind him mirror him to
        below the horizon, as others do.
        """
        incoming, outgoing = expect_both(incoming, outgoing, *self._each)
        half, cosine = _half(incoming, outgoing)
        # A half vector and its opposite give the same direction; one of them can be drawn.
        half = np.where(half[..., 2:] < 0, -half, half)
        density = cosine_power_density(half, self.exponent_x, self.exponent_y)
        return density / (4 * np.maximum(cosine, np.finfo(incoming.dtype).eps))


class AshikhminShirleyDiffuse:
    """The diffuse lobe of a surface with a specular one above: less of it near the horizon.

    Parameters
    ----------
    albedo : float or (..., n_channels) array_like
        0 to 1.
    reflectance : float or (..., n_channels) array_like
        Of the specular lobe, seen from straight on, 0 to 1.

    Source: Ashikhmin and Shirley 2000, equation 5.
    """

    def __init__(self, albedo, reflectance):
        self.albedo = expect_colour("albedo", albedo, 1)
        self.reflectance = expect_colour("reflectance", reflectance, 1)

    @property
    def n_channels(self):
        """Of albedo and reflectance."""
        return max(self.albedo.shape[-1], self.reflectance.shape[-1])

    def eval(self, incoming, outgoing):
        """See `Reflectance.eval`."""
        incoming, outgoing = expect_both(incoming, outgoing, self.albedo[..., 0])
        colour = 28 / (23 * np.pi) * self.albedo * (1 - self.reflectance)
        (colour,) = in_type_of(incoming, colour)
        share = both_above(incoming, outgoing).astype(incoming.dtype)
        for direction in (incoming, outgoing):
            share = share * (1 - (1 - np.clip(direction[..., 2], 0, 1) / 2) ** 5)
        return share[..., None] * colour

    def sample(self, outgoing, uv):
        """See `Reflectance.sample`."""
        return square_to_cosine(expect_viewed(outgoing, uv)[1])

    def pdf(self, incoming, outgoing):
        """See `Reflectance.pdf`."""
        incoming, outgoing = expect_both(incoming, outgoing)
        shape = np.broadcast_shapes(incoming.shape, outgoing.shape)[:-1]
        return np.broadcast_to(cosine_density(incoming[..., 2]), shape)


def _half(incoming, outgoing):
    """The unit vectors half-way (..., 3), and their cosines (...) with either direction."""
    half = incoming + outgoing
    length = np.sqrt((half * half).sum(axis=-1))
    half = half / np.maximum(length, np.finfo(half.dtype).eps)[..., None]
    # Of two unit vectors: half the length of their sum.
    return half, np.minimum(length / 2, 1)
