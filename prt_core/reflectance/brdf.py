"""What a BRDF answers, and what is done with any of them.

Everything is in the local frame of a surface: z is its normal, x its tangent (see `local_frames`).
`incoming` points from the surface to the light, `outgoing` to the viewer, always in this order.
Directions are (..., 3) unit vectors whose leading axes broadcast. Parameters of lobes are numbers
or arrays that broadcast against these leading axes, colours have an axis of channels more: n points
with a roughness (n, 1) and a colour (n, 1, 3) answer for m directions each, (n, m, 3), in one call.
Work is done in float32 where both directions are float32, else in float64.
"""

from typing import Protocol, runtime_checkable

import numpy as np

from prt_core.errors import (
    expect,
    expect_all,
    expect_kind,
    expect_whole,
    shown,
)
from prt_core.reflectance.arrays import expect_directions, expect_parameter, expect_square
from prt_core.sphere import sobol_points, tangents

# Numbers of directions that are worked on together.
_AT_ONCE = 1 << 18


@runtime_checkable
class Reflectance(Protocol):
    """A BRDF, or a part of one (a lobe).

    Attributes
    ----------
    n_channels : int
        1 where it has no colour.
    """

    n_channels: int

    def eval(self, incoming, outgoing):
        """The BRDF of incoming and outgoing (..., 3), without the cosine: (..., n_channels)."""

    def sample(self, outgoing, uv):
        """Directions to the light (..., 3) of outgoing (..., 3) and uv (..., 2), about as eval."""

    def pdf(self, incoming, outgoing):
        """Density (...) of `sample`, per solid angle, at incoming of outgoing (..., 3)."""


class Sum:
    """Lobes beside each other.

    Parameters
    ----------
    lobes : list of Reflectance
        With one number of channels, or 1.
    shares : sequence of float, optional
        How often `sample` takes each of them; default: evenly. They are scaled to sum to 1.

    Raises
    ------
    PRTError
        No lobe, something that is none, or shares that are none.
    """

    def __init__(self, lobes, shares=None):
        self.lobes = expect_all("lobes", lobes, Reflectance, "BRDFs")
        n = len(self.lobes)
        expect(n, "lobes: expected one or more BRDFs, got none")
        shares = expect_parameter("shares", np.ones(n) if shares is None else shares, least=0)
        expect(
            shares.shape == (n,) and shares.sum() > 0,
            f"shares: expected {n} numbers, not all of them 0, got {shown(shares)}",
        )
        self.shares = shares / shares.sum()
        channels = {lobe.n_channels for lobe in self.lobes}
        self.n_channels = max(channels)
        expect(
            channels <= {1, self.n_channels},
            f"lobes: expected one number of channels, or 1, got {sorted(channels)}",
        )

    @property
    def roughness(self):
        """Slider of the narrowest lobe that says it; 1 where none does."""
        said = (getattr(lobe, "roughness", 1.0) for lobe in self.lobes)
        return min(float(np.min(roughness)) for roughness in said)

    def eval(self, incoming, outgoing):
        """See `Reflectance.eval`."""
        return sum(lobe.eval(incoming, outgoing) for lobe in self.lobes)

    def sample(self, outgoing, uv):
        """See `Reflectance.sample`."""
        uv, last = expect_square(uv), len(self.lobes) - 1
        ends = np.cumsum(self.shares)
        chosen = np.minimum(np.searchsorted(ends, uv[..., 0], side="right"), last)
        first = (ends - self.shares)[chosen]
        # What is left of the number that chose is as random as it was.
        again = np.clip((uv[..., 0] - first) / self.shares[chosen], 0, 1 - np.finfo(uv.dtype).eps)
        uv = np.stack([again.astype(uv.dtype), uv[..., 1]], axis=-1)
        samples = [lobe.sample(outgoing, uv) for lobe in self.lobes]
        return np.choose(chosen[..., None], np.broadcast_arrays(*samples))

    def pdf(self, incoming, outgoing):
        """See `Reflectance.pdf`."""
        densities = (lobe.pdf(incoming, outgoing) for lobe in self.lobes)
        # Numbers of Python's own leave float32 what it is.
        shares = self.shares.tolist()
        return sum(share * density for share, density in zip(shares, densities, strict=True))


def directional_albedo(reflectance, outgoing, power=12):
    """The share of even light from everywhere that leaves towards a viewer.

    Parameters
    ----------
    reflectance : Reflectance
    outgoing : (..., 3) float
        Unit vectors; the leading axes are those that its parameters broadcast against.
    power : int
        2 to this many samples of each direction. 12: within 0.1 % for smooth lobes.

    Returns
    -------
    (..., n_channels) array
    """
    expect_kind("reflectance", reflectance, Reflectance, "a BRDF")
    outgoing = expect_directions("outgoing", outgoing)
    n_samples = 2 ** expect_whole("power", power, 0, 20)
    uv = (sobol_points(power) + 0.5 / n_samples).astype(outgoing.dtype)
    # Samples come first, so that parameters broadcast as before.
    uv = uv.reshape(-1, *(1,) * (outgoing.ndim - 1), 2)
    total, at_once = 0.0, max(1, _AT_ONCE // max(outgoing.size, 1))
    for first in range(0, n_samples, at_once):
        incoming = reflectance.sample(outgoing, uv[first : first + at_once])
        density = reflectance.pdf(incoming, outgoing)
        weight = incoming[..., 2] / np.where(density > 0, density, np.inf)
        total = total + (reflectance.eval(incoming, outgoing) * weight[..., None]).sum(axis=0)
    return total / n_samples


def local_frames(normals, tangent=None):
    """Frames of surfaces: z along the normal, x along the tangent.

    Parameters
    ----------
    normals : (n, 3) float
        Unit vectors in the world.
    tangent : (n, 3) float, optional
        Of any length and direction; only what is at right angles to the normal counts. Where
        nothing is left (no tangent), some direction is taken, which turns smoothly.

    Returns
    -------
    (n, 3, 3) float64
        Rows are x, y and z: `frames @ direction` is local, `local @ frames` in the world.
    """
    z = expect_directions("normals", normals).astype(np.float64)
    x, y = tangents(z)
    if tangent is not None:
        wanted = expect_directions("tangent", tangent).astype(np.float64)
        expect(
            wanted.shape == z.shape,
            f"tangent: expected one for each normal, {z.shape}, got {wanted.shape}",
        )
        across = np.cross(z, wanted)
        length = np.linalg.norm(across, axis=1, keepdims=True)
        there = length > 1e-6 * np.linalg.norm(wanted, axis=1, keepdims=True)
        y = np.where(there, across / np.where(there, length, 1), y)
        x = np.cross(y, z)
    return np.stack([x, y, z], axis=1)
