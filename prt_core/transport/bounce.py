"""All bounces: B = albedo (E + K B), by the Neumann series with a measured remainder."""

import numpy as np

from prt_core.errors import PRTError

_MOST = 2000


def all_bounces(gather, albedo, received, tolerance=1e-3, bounces=None, mean_albedo=None):
    """Outgoing radiance with the light between surfaces.

    Parameters
    ----------
    gather : (n_points, n_points) CSR float32, or None
        K; None for direct light only.
    albedo : (n_points, n_channels) float32
    received : (n_points, n_channels) float32
        Direct irradiance / pi (see `received_light`).
    tolerance : float
        The series ends when the remainder, as a share of the sum, is below it.
    bounces : int, optional
        Exactly so many bounces after the direct light; default: as many as `tolerance` needs.
    mean_albedo : (n_points, n_channels) float32, optional
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
    total = albedo * received
    if gather is None or bounces == 0:
        return total, 0
    if mean_albedo is None:
        mean_albedo = albedo
    sent, before = (total if mean_albedo is albedo else mean_albedo * received), None
    for bounce in range(1, (bounces or _MOST) + 1):
        arrives = gather @ sent
        term = albedo * arrives
        sent = term if mean_albedo is albedo else mean_albedo * arrives
        total = total + term
        size = float(np.abs(term).sum(dtype=np.float64))
        if bounces is None:
            ratio = 0.0 if not before else size / before
            remainder = size * ratio / max(1 - ratio, 1e-9)
            if remainder <= tolerance * float(np.abs(total).sum(dtype=np.float64)) and bounce > 1:
                return total, bounce
            before = size
    if bounces is not None:
        return total, bounces
    raise PRTError(
        f"bounces: the light has not settled after {_MOST} bounces; an albedo of "
        f"{mean_albedo.max():.3f} in a closed space reflects for ever: lower it, or set --bounces"
    )
