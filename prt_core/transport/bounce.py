"""All bounces: B = albedo (E + K B), by the Neumann series with a measured remainder."""

import numpy as np

from prt_core.errors import (
    PRTError,
    expect,
    expect_array,
    expect_number,
    expect_whole,
    shown,
)
from prt_core.reflectance import QUANTITIES
from prt_core.transport.exit_radiance import ExitRadiance
from prt_core.transport.sent import Sent

# Bounces after which the light must have settled: as many as are needed, or a number asked for.
_MOST, _MOST_ASKED = 2000, 20_000
MOST_ALBEDO = QUANTITIES["albedo"].highest(bounced=True)
# Of float32, so that sums of many bounces stay numbers.
MOST_RECEIVED = 1e30


def all_bounces(gather, albedo, received, tolerance=1e-3, bounces=None, mean_albedo=None):
    """Outgoing radiance with the light between surfaces.

    Parameters
    ----------
    gather : (n_points, n_points) CSR float32, or None
        K; None for direct light only.
    albedo : (n_points, n_channels) float32, or Sent
    received : (n_points, n_channels) float32
        Direct irradiance / pi (see `received_light`).
    tolerance : float
        The series ends when the remainder, as a share of the sum, is below it.
    bounces : int, optional
        Exactly so many bounces after the direct light, unless nothing is added any more; default:
        as many as `tolerance` needs.
    mean_albedo : (n_points, n_channels) float32, or Sent, optional
        Of the area that each point stands for, with which it bounces; default: `albedo`.

    Returns
    -------
    radiance : (n_points, n_channels) float32
    n_bounces : int

    Raises
    ------
    PRTError
        The series does not converge: surfaces reflect all they receive and nothing escapes.
    """
    shown = MOST_ALBEDO if mean_albedo is None else QUANTITIES["albedo"].highest()
    albedo = sends = _expect_albedo("albedo", albedo, most=shown)
    if mean_albedo is not None:
        sends = _expect_albedo("mean_albedo", mean_albedo, _albedo_of(albedo).shape)
    arrived, n_bounces = received_with_bounces(gather, sends, received, tolerance, bounces)
    return ExitRadiance(arrived, albedo).toward(), n_bounces


def received_with_bounces(gather, albedo, received, tolerance=1e-3, bounces=None):
    """What points receive with the light between surfaces: E + K A E + K A K A E ...

    Parameters
    ----------
    gather : (n_points, n_points) CSR float32, or None
    albedo : (n_points, n_channels) float32, or Sent
        With which points bounce.
    received : (n_points, n_channels) float32
    tolerance : float
    bounces : int, optional
        See `all_bounces`.

    Returns
    -------
    received : (n_points, n_channels) float32
    n_bounces : int
    """
    sends = _expect_albedo("albedo", albedo)
    albedo = _albedo_of(sends)
    received = expect_array(
        "received", received, (len(albedo), None), least=-MOST_RECEIVED, most=MOST_RECEIVED
    )
    expect(
        albedo.shape[1] in (1, received.shape[1]),
        f"albedo: expected {received.shape[1]} channels as received, got {albedo.shape[1]}",
    )
    tolerance = expect_number("tolerance", tolerance, above=0, below=1)
    if bounces is not None:
        expect_whole("bounces", bounces, 0)
    expect_gather(gather, len(albedo))
    if gather is None:
        return received, 0
    send = sends if isinstance(sends, Sent) else lambda term: albedo * term
    return bounce_series(lambda term: gather @ send(term), received, albedo, tolerance, bounces)


def _albedo_of(sends):
    return sends.albedo if isinstance(sends, Sent) else sends


def _expect_albedo(name, albedo, shape=(None, None), most=MOST_ALBEDO):
    """Albedo, or the `Sent` that it is part of, checked."""
    if isinstance(albedo, Sent):
        expect_array(name, albedo.albedo, shape, least=0, most=most)
        return albedo
    return expect_array(name, albedo, shape, least=0, most=most)


def expect_gather(gather, n_points):
    """Raise `PRTError` unless this is K of so many points, or None."""
    if gather is not None:
        good = hasattr(gather, "__matmul__") and not isinstance(gather, np.ndarray)
        wanted = n_points, n_points
        good = good and getattr(gather, "shape", wanted) == wanted
        expect(good, f"gather: expected a sparse matrix of shape {wanted}, got {shown(gather)}")


def bounce_series(step, first, albedo, tolerance, bounces):
    """The sum of `first`, `step(first)`, `step(step(first))` ... and how many steps it took.

    Parameters
    ----------
    step : callable
        One bounce of the light.
    first : (n_points, k) float32
    albedo : (n_points, n_channels) float32
        For the message where there is no end.
    tolerance, bounces
        See `all_bounces`.
    """
    total, term, before = first, first, None
    most = _MOST if bounces is None else min(bounces, _MOST_ASKED)
    for bounce in range(1, most + 1):
        term = step(term)
        sum_before, total = total, total + term
        if bounces is not None:
            # What no longer adds to any point will not add to another: it comes from these.
            if bounce < bounces and (total == sum_before).all():
                return total, bounce
            continue
        size = float(np.abs(term).sum(dtype=np.float64))
        ratio = 0.0 if not before else size / before
        remainder = size * ratio / max(1 - ratio, 1e-9)
        if remainder <= tolerance * float(np.abs(total).sum(dtype=np.float64)) and bounce > 1:
            return total, bounce
        before = size
    if bounces is not None and bounces <= most:
        return total, bounces
    raise PRTError(
        f"bounces: the light has not settled after {most:,} bounces; an albedo of "
        f"{albedo.max():.3f} in a closed space reflects for ever: lower it, or set --bounces"
    )
