"""How much of the light smooth surfaces reflect: by the angle, and in the mean.

Cosines are those between the light and the facet that mirrors it to the viewer. Every term is
called with them, (...), and returns (..., n_channels); `mean` is what it has over all directions,
weighted by the cosine, which is the colour of light that goes from facet to facet.
"""

import numpy as np

from prt_core.reflectance.arrays import (
    channel_of,
    expect_colour,
    expect_fitting,
    expect_parameter,
    from_channels,
    in_type_of,
)

# Cosine at which F82 has its tint, and Schlick's share of white there.
_F82_COSINE = 1 / 7
_F82_SHARE = (6 / 7) ** 5


class Constant:
    """The same from all sides.

    Parameters
    ----------
    colour : float or (..., n_channels) array_like
    """

    def __init__(self, colour=1.0):
        self.colour = expect_colour("colour", colour)

    @property
    def n_channels(self):
        """Of the colour."""
        return self.colour.shape[-1]

    @property
    def mean(self):
        """(..., n_channels) array: the colour, 1 at most."""
        return np.minimum(self.colour, 1)

    def __call__(self, cosine):
        """(..., n_channels) array at cosine (...)."""
        (colour,) = in_type_of(cosine, self.colour)
        return np.broadcast_to(colour, np.broadcast_shapes((*cosine.shape, 1), colour.shape))


class Dielectric:
    """The real curve of glass, varnish or water, from outside.

    Parameters
    ----------
    ior : float or (...) array_like
        Above 0; below 1 all light is reflected beyond some angle.
    """

    n_channels = 1

    def __init__(self, ior):
        self.ior = expect_ior("ior", ior)

    @property
    def mean(self):
        """(..., 1) array."""
        return mean_dielectric(self.ior)[..., None]

    def __call__(self, cosine):
        """(..., 1) array at cosine (...)."""
        return dielectric(cosine, *in_type_of(cosine, self.ior))[..., None]


class RealSchlick:
    """A colour seen from straight on, which goes to another near the horizon as a dielectric's.

    That is the specular layer of Blender's Principled BSDF.

    Parameters
    ----------
    f0, f90 : float or (..., n_channels) array_like
        Seen from straight on (1 at most is taken of it) and near the horizon.
    ior : float or (...) array_like
        Of the dielectric whose curve it is.
    """

    def __init__(self, f0, f90, ior):
        self.f0 = np.minimum(expect_colour("f0", f0), 1)
        self.f90 = expect_colour("f90", f90)
        self.ior = expect_ior("ior", ior)
        expect_fitting(f0=self.f0, f90=self.f90, ior=self.ior[..., None])

    @property
    def n_channels(self):
        """Of both colours."""
        return max(self.f0.shape[-1], self.f90.shape[-1])

    @property
    def mean(self):
        """(..., n_channels) array."""
        share = _along(f0_of_ior(self.ior), mean_dielectric(self.ior))[..., None]
        return self.f0 + (self.f90 - self.f0) * share

    def __call__(self, cosine):
        """(..., n_channels) array at cosine (...)."""
        f0, f90, ior = in_type_of(cosine, self.f0, self.f90, self.ior)
        share, rest = _along(f0_of_ior(ior), dielectric(cosine, ior)), f90 - f0
        return from_channels(
            self.n_channels, lambda k: channel_of(f0, k) + channel_of(rest, k) * share
        )


class F82Tint:
    """Metals: Schlick's curve from a colour to white, with a tint shortly before the horizon.

    Parameters
    ----------
    f0 : float or (..., n_channels) array_like
        Seen from straight on, 0 to 1 of `weight`.
    tint : float or (..., n_channels) array_like
        0 to 1; with 1 it is Schlick's curve.
    weight : float or (..., 1) array_like
        What it is near the horizon, where this is a share of a surface.

    Source: Kutz, Hasan and Edmondson 2021, Novel aspects of the Adobe Standard Material.
    """

    def __init__(self, f0, tint=1.0, weight=1.0):
        self.f0 = expect_colour("f0", f0)
        self.tint = np.minimum(expect_colour("tint", tint), 1)
        self.weight = expect_colour("weight", weight)
        expect_fitting(f0=self.f0, tint=self.tint, weight=self.weight)
        schlick = self.f0 + (self.weight - self.f0) * _F82_SHARE
        self._dip = schlick * (1 - self.tint) / (_F82_SHARE * (1 - _F82_COSINE) * _F82_COSINE)

    @property
    def n_channels(self):
        """Of both colours."""
        return max(self.f0.shape[-1], self.tint.shape[-1])

    @property
    def mean(self):
        """(..., n_channels) array: the mean of what is not white, where that has a weight."""
        mean = self.f0 + (self.weight - self.f0) / 21 - self._dip / 126
        return mean / np.where(self.weight > 0, self.weight, 1)

    def __call__(self, cosine):
        """(..., n_channels) array at cosine (...)."""
        f0, dip, weight = in_type_of(cosine, self.f0, self._dip, self.weight)
        near = np.clip(1 - cosine, 0, 1)
        fifth = near * near
        fifth = fifth * fifth * near
        sixth, rest = cosine * fifth * near, weight - f0

        def channel(k):
            value = channel_of(f0, k) + channel_of(rest, k) * fifth
            if not self._dip.any():
                return value
            value = value - channel_of(dip, k) * sixth
            return np.minimum(np.maximum(value, 0), channel_of(weight, k))

        return from_channels(self.n_channels, channel)


def dielectric(cosine, ior):
    """Reflectance of unpolarised light at a smooth dielectric, from outside.

    Parameters
    ----------
    cosine : (...) float
        0 to 1, between the light and the normal.
    ior : float or (...) float
        Relative index of refraction.

    Returns
    -------
    (...) array
    """
    squared = ior * ior - 1 + cosine * cosine
    through = np.sqrt(np.maximum(squared, 0))
    total = cosine + through
    tiny = np.finfo(total.dtype).tiny
    across = (through - cosine) / np.maximum(total, tiny)
    # Along the plane, as a factor of the above.
    factor = (cosine * total - 1) / np.maximum(cosine * (through - cosine) + 1, tiny)
    value = across * across * (1 + factor * factor) / 2
    return np.where(squared > 0, np.minimum(value, 1), 1)


def f0_of_ior(ior):
    """(...) reflectance of a dielectric of `ior` (...) seen from straight on."""
    return ((ior - 1) / (ior + 1)) ** 2


def mean_dielectric(ior):
    """(...) mean reflectance of a dielectric of `ior` (...), from outside.

    Source: Kulla and Conty 2017, Revisiting physically based shading at Imageworks (a fit).
    """
    below = 0.997118 + ior * (0.1014 - ior * (0.965241 + ior * 0.130607))
    return np.where(ior < 1, below, (ior - 1) / (4.08567 + 1.00071 * ior))


def expect_ior(name, value):
    """An index of refraction: a number or an array of any shape, as float64, 1e-5 or more."""
    return np.maximum(expect_parameter(name, value, 0), 1e-5)


def _along(f0, value):
    """How far a value is on the way from f0 to 1."""
    rest = 1 - f0
    return np.clip((value - f0) / np.where(rest > 1e-6, rest, 1), 0, 1)
