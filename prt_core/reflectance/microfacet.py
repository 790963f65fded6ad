"""GGX microfacets, as Cycles has them: Glossy, metals, specular layers and coats."""

import numpy as np

from prt_core.errors import expect_offers
from prt_core.reflectance.arrays import (
    both_above,
    channel_of,
    expect_both,
    expect_parameter,
    expect_viewed,
    from_channels,
    in_type_of,
    mirrored,
)
from prt_core.reflectance.energy import ggx_albedo, ggx_mean_albedo
from prt_core.reflectance.fresnel import Constant
from prt_core.sphere import ggx_density, square_to_ggx_normals

# Smaller is taken as this: what Cycles renders as a perfect mirror is no function of directions.
SMALLEST_ALPHA = 1e-4


def alphas(roughness, anisotropy=0.0):
    """Roughness along and across the tangent, of the sliders of the Principled BSDF.

    Parameters
    ----------
    roughness : float or (...) array_like
        0 to 1; the roughness of a lobe is its square.
    anisotropy : float or (...) array_like
        0 to 1.

    Returns
    -------
    alpha_x, alpha_y : (...) float64
        `SMALLEST_ALPHA` to 1.
    """
    alpha = expect_parameter("roughness", roughness, 0, 1) ** 2
    aspect = np.sqrt(1 - 0.9 * expect_parameter("anisotropy", anisotropy, 0, 1))
    return tuple(np.clip(a, SMALLEST_ALPHA, 1) for a in (alpha / aspect, alpha * aspect))


def glossy_anisotropy(slider):
    """The anisotropy of Blender's Glossy BSDF, in that of the Principled BSDF.

    Parameters
    ----------
    slider : float or (...) array_like
        -1 to 1. Beyond 0.68 lobes are narrower than the Principled BSDF makes them; these are 1.

    Returns
    -------
    anisotropy : (...) float64
        0 to 1, see `alphas`.
    turned : (...) bool
        Whether the tangent turns by a right angle about the normal.
    """
    slider = expect_parameter("slider", slider, -1, 1)
    return np.minimum((1 - (1 - np.abs(slider)) ** 2) / 0.9, 1), slider > 0


class Microfacet:
    """A GGX lobe with the Smith term of both directions together.

    The light of further bounces between facets is added as in Cycles' "Multiscatter GGX", by a
    factor of the view: white stays white at any roughness, and colours become deeper. With it the
    lobe is not reciprocal.

    Source: Walter et al. 2007; Heitz 2014, Understanding the masking-shadowing function, equation
    99; Kulla and Conty 2017, Revisiting physically based shading at Imageworks.

    Parameters
    ----------
    alpha_x, alpha_y : float or (...) array_like
        Roughness along x and y, 0 to 1; at least `SMALLEST_ALPHA` is taken. See `alphas`.
    fresnel : callable, optional
        A term of `prt_core.reflectance.fresnel`; default: white from all sides.
    multiple : bool, float or (...) array_like
        Whether light of further bounces is added, or how much of it: 0 to 1.
    """

    def __init__(self, alpha_x, alpha_y, fresnel=None, multiple=True):
        self.alpha_x, self.alpha_y = (
            np.maximum(expect_parameter(name, value, 0, 1), SMALLEST_ALPHA)
            for name, value in (("alpha_x", alpha_x), ("alpha_y", alpha_y))
        )
        if fresnel is not None:
            wanted = "a term of prt_core.reflectance.fresnel"
            expect_offers("fresnel", fresnel, ("n_channels", "mean"), wanted)
        self.fresnel = Constant() if fresnel is None else fresnel
        multiple = float(multiple) if isinstance(multiple, bool) else multiple
        self.multiple = expect_parameter("multiple", multiple, 0, 1)
        # What has to fit the directions.
        self._each = self.alpha_x, self.alpha_y, self.fresnel.mean[..., 0], self.multiple

    @property
    def n_channels(self):
        """Of the Fresnel term."""
        return self.fresnel.n_channels

    @property
    def roughness(self):
        """(...) slider of a lobe that has the same area of facets, but no anisotropy."""
        return (self.alpha_x * self.alpha_y) ** 0.25

    def eval(self, incoming, outgoing):
        """See `Reflectance.eval`."""
        incoming, outgoing = expect_both(incoming, outgoing, *self._each)
        alpha_x, alpha_y = in_type_of(incoming, self.alpha_x, self.alpha_y)
        half = incoming + outgoing
        # The lengths of stretched directions are the Smith terms without a quotient by a cosine.
        lengths = [_stretched(d, alpha_x, alpha_y) for d in (incoming, outgoing)]
        heights = [np.maximum(d[..., 2], 0) for d in (incoming, outgoing)]
        masked = heights[0] * lengths[1] + heights[1] * lengths[0]
        value = ggx_density(half, alpha_x, alpha_y) * both_above(incoming, outgoing)
        value = value / np.maximum(2 * masked, np.finfo(value.dtype).eps)
        # Of two unit vectors: half the length of their sum is the cosine with the half vector.
        cosine = np.minimum(np.sqrt(_squared(half)) / 2, 1)
        fresnel = self.fresnel(cosine)
        gain = self.gain(outgoing) if self.multiple.any() else np.ones(1, value.dtype)
        return from_channels(
            self.n_channels,
            lambda k: channel_of(fresnel, k) * channel_of(gain, k) * value,
        )

    def sample(self, outgoing, uv):
        """See `Reflectance.sample`; what falls below the horizon has no reflectance."""
        outgoing, uv = expect_viewed(outgoing, uv, *self._each)
        return mirrored(outgoing, square_to_ggx_normals(uv, outgoing, self.alpha_x, self.alpha_y))

    def pdf(self, incoming, outgoing):
        """See `Reflectance.pdf`."""
        incoming, outgoing = expect_both(incoming, outgoing, *self._each)
        alpha_x, alpha_y = in_type_of(incoming, self.alpha_x, self.alpha_y)
        half = incoming + outgoing
        height = np.maximum(outgoing[..., 2], 0) + _stretched(outgoing, alpha_x, alpha_y)
        density = ggx_density(half, alpha_x, alpha_y) / (2 * height)
        return np.where((half[..., 2] > 0) & (outgoing[..., 2] > 0), density, 0)

    def gain(self, outgoing):
        """What light of further bounces makes of the lobe: a factor of the view.

        Parameters
        ----------
        outgoing : (..., 3) float

        Returns
        -------
        (..., n_channels) array
        """
        rough = self.roughness
        albedo, mean = ggx_albedo(rough, outgoing[..., 2]), ggx_mean_albedo(rough)[..., None]
        colour = self.fresnel.mean
        further = colour * mean / (1 - colour * (1 - mean))
        gain = 1 + further * (self.multiple * (1 / albedo - 1))[..., None]
        return gain.astype(outgoing.dtype, copy=False)

    def darkening(self, outgoing):
        """`gain` of outgoing (..., 3) in parts of that of a white lobe: (..., n_channels)."""
        white = 1 + self.multiple * (1 / ggx_albedo(self.roughness, outgoing[..., 2]) - 1)
        return self.gain(outgoing) / white[..., None].astype(outgoing.dtype, copy=False)


def _stretched(directions, alpha_x, alpha_y):
    x, y, z = (directions[..., k] for k in range(3))
    return np.sqrt((alpha_x * x) ** 2 + (alpha_y * y) ** 2 + z * z)


def _squared(vectors):
    x, y, z = (vectors[..., k] for k in range(3))
    return x * x + y * y + z * z
