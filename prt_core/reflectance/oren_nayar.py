"""Rough diffuse surfaces: Oren and Nayar's model as Cycles has it (Diffuse Roughness).

Fujii's improved form, which is smooth everywhere, and the light of more than one bounce between its
facets after the OpenPBR specification, so that white is white at any roughness.
"""

import numpy as np

from prt_core.reflectance.arrays import (
    both_above,
    expect_both,
    expect_colour,
    expect_fitting,
    expect_parameter,
    expect_viewed,
    in_type_of,
)
from prt_core.sphere import cosine_density, square_to_cosine

# What one bounce between facets loses at most, and in the mean over all directions.
_MOST, _MEAN = np.pi / 2 - 2 / 3, (2 * np.pi - 5.6) / 3


class OrenNayar:
    """The rough diffuse BRDF.

    Source: Fujii 2012, A tiny improvement of Oren-Nayar reflectance model; Portsmouth, Kutz and
    Hill 2024, EON: a practical energy-preserving rough diffuse BRDF. Cycles takes the colour a
    third time for the light of further bounces, where the latter has it twice; so does this.

    Parameters
    ----------
    albedo : float or (..., n_channels) array_like
        Weight and colour of the light that leaves.
    roughness : float or (...) array_like
        0 (Lambert) to 1.
    colour : float or (..., n_channels) array_like, optional
        Of the facets, 0 to 1, where `albedo` has a weight besides; default: albedo, 1 at most.
    """

    def __init__(self, albedo=1.0, roughness=0.0, colour=None):
        self.albedo = expect_colour("albedo", albedo)
        self.diffuse_roughness = expect_parameter("roughness", roughness, 0, 1)
        self.colour = np.minimum(
            self.albedo if colour is None else expect_colour("colour", colour), 1
        )
        rough = self.diffuse_roughness[..., None]
        expect_fitting(albedo=self.albedo, roughness=rough, colour=self.colour)

    @property
    def n_channels(self):
        """Of albedo and colour."""
        return max(self.albedo.shape[-1], self.colour.shape[-1])

    def eval(self, incoming, outgoing):
        """See `Reflectance.eval`."""
        incoming, outgoing = expect_both(
            incoming, outgoing, self.diffuse_roughness, self.albedo[..., 0]
        )
        albedo, rough, colour = in_type_of(
            incoming, self.albedo, self.diffuse_roughness, self.colour
        )
        cosines = [np.clip(d[..., 2], 0, 1) for d in (incoming, outgoing)]
        flat = incoming[..., 0] * outgoing[..., 0] + incoming[..., 1] * outgoing[..., 1]
        single, lost = rough_parts(*cosines, flat, rough)
        further = colour**2 / (1 - colour * lost_in_mean(rough)[..., None]) * lost[..., None]
        value = albedo * (single[..., None] + further)
        return np.where(both_above(incoming, outgoing)[..., None], value, 0).astype(incoming.dtype)

    def sample(self, outgoing, uv):
        """See `Reflectance.sample`."""
        return square_to_cosine(expect_viewed(outgoing, uv)[1])

    def pdf(self, incoming, outgoing):
        """See `Reflectance.pdf`."""
        incoming, outgoing = expect_both(incoming, outgoing)
        shape = np.broadcast_shapes(incoming.shape, outgoing.shape)[:-1]
        return np.broadcast_to(cosine_density(incoming[..., 2]), shape)


def seen_from_above(cosine, roughness, colour):
    """What rough diffuse surfaces make of light, as seen from straight above: Lambert's is 1.

    Parameters
    ----------
    cosine : (n,) float
        Between light and normal, above 0.
    roughness : (n,) float
    colour : (n, n_channels) float
        Albedo.

    Returns
    -------
    (n, n_channels) float
    """
    incoming = np.stack([np.sqrt(np.maximum(1 - cosine**2, 0)), 0 * cosine, cosine], axis=1)
    outgoing = np.broadcast_to([0.0, 0.0, 1.0], incoming.shape)
    return np.pi * OrenNayar(1.0, roughness, np.clip(colour, 0, 1)).eval(incoming, outgoing)


def rough_parts(cosine, other, flat, rough):
    """The rough diffuse BRDF of white facets, by what bounces once and what bounces again.

    Parameters
    ----------
    cosine, other : (...) float
        Between the normal and both directions, 0 to 1.
    flat : (...) float
        Product of what both directions have along the surface.
    rough : (...) float
        0 to 1.

    Returns
    -------
    single : (...) array
    further : (...) array
        Of facets of a colour c times c^2 / (1 - c lost_in_mean(rough)).
    """
    a = 1 / (np.pi + rough * _MOST).astype(cosine.dtype)
    b = rough * a
    highest = np.maximum(np.maximum(cosine, other), np.finfo(cosine.dtype).eps)
    single = a + b * np.where(flat > 0, flat / highest, flat)
    # In this form nothing is subtracted that is almost the same: it is 0 for roughness 0.
    lost = (_MOST - _facing(cosine)) * (_MOST - _facing(other)) / (_MOST - _MEAN)
    return single, b * lost * (1 - lost_in_mean(rough)) / np.pi


def lost_in_mean(rough):
    """What one bounce between facets loses of even light, of roughness (...)."""
    return rough / (np.pi + rough * _MOST) * (_MOST - _MEAN)


def _facing(cosine):
    """Fujii's term G of cosines (...): what facets turned towards the viewer send more."""
    sine = np.sqrt(np.maximum(1 - cosine * cosine, 0))
    # (1 - sine^3) / cosine, without a difference near the horizon.
    slope = cosine * (1 + sine + sine * sine) / (1 + sine)
    return sine * (np.arccos(cosine) - 2 / 3 - sine * cosine + 2 / 3 * slope)
