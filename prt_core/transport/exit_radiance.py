"""What leaves a surface: the view stage, after light has arrived.

Exact transport and every compressed form end in what points receive, with all bounces. What a
viewer sees of that is worked out here and nowhere else, so that nobody has to know where the light
came from, and no form holds what belongs to the surface.
"""

from dataclasses import dataclass

import numpy as np

from prt_core.errors import expect, expect_numbers
from prt_core.transport.sent import Sent


@dataclass(frozen=True)
class ExitRadiance:
    """Radiance that points send out.

    Attributes
    ----------
    received : (n_points, ..., n_channels) float
        Irradiance / pi with all bounces (see `Transport.product`, `Compressor.product`); of many
        lights where there are axes between.
    albedo : (n_points, n_channels) float, or Sent
        Of the points themselves, not of the area that they stand for.
    """

    received: np.ndarray
    albedo: np.ndarray

    def __post_init__(self):
        received = expect_numbers("received", self.received)
        albedo = self.albedo.albedo if isinstance(self.albedo, Sent) else self.albedo
        albedo = expect_numbers("albedo", albedo)
        expect(
            albedo.ndim == 2 and received.ndim > 1 and len(received) == len(albedo)
            and albedo.shape[1] in (1, received.shape[-1]),
            f"albedo: expected one of each point and channel of received, {received.shape}, "
            f"got {albedo.shape}",
        )  # fmt: skip

    def toward(self, view=None):
        """Radiance toward a view.

        Parameters
        ----------
        view : object, optional
            Not needed: diffuse surfaces look the same from everywhere.

        Returns
        -------
        (n_points, ..., n_channels) float
            Linear Rec.709, of the type of what was received.
        """
        if isinstance(self.albedo, Sent):
            return self.albedo(self.received)
        between = (1,) * (self.received.ndim - 2)
        shape = len(self.albedo), *between, self.albedo.shape[1]
        return self.albedo.reshape(shape) * self.received
