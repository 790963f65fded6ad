"""Lambert's BRDF: light leaves evenly to all sides."""

import numpy as np

from prt_core.reflectance.arrays import (
    both_above,
    expect_both,
    expect_colour,
    expect_viewed,
    in_type_of,
)
from prt_core.sphere import cosine_density, square_to_cosine


class Lambert:
    """Albedo over pi.

    Parameters
    ----------
    albedo : float or (..., n_channels) array_like
    """

    def __init__(self, albedo=1.0):
        self.albedo = expect_colour("albedo", albedo)

    @property
    def n_channels(self):
        """Of the albedo."""
        return self.albedo.shape[-1]

    def eval(self, incoming, outgoing):
        """See `Reflectance.eval`."""
        incoming, outgoing = expect_both(incoming, outgoing, self.albedo[..., 0])
        (colour,) = in_type_of(incoming, self.albedo / np.pi)
        return both_above(incoming, outgoing)[..., None] * colour

    def sample(self, outgoing, uv):
        """See `Reflectance.sample`."""
        return square_to_cosine(expect_viewed(outgoing, uv)[1])

    def pdf(self, incoming, outgoing):
        """See `Reflectance.pdf`."""
        incoming, outgoing = expect_both(incoming, outgoing)
        shape = np.broadcast_shapes(incoming.shape, outgoing.shape)[:-1]
        return np.broadcast_to(cosine_density(incoming[..., 2]), shape)
