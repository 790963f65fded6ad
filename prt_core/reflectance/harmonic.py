"""A reflectance as harmonics of the incoming light, for every view (Kautz et al. 2002).

An isotropic one turns with the viewer: its coefficients are known for some elevations of the view,
and turned about the normal, which mixes only the two harmonics of one degree and order.

Where no light arrives from below the horizon, it does not matter what the harmonics say there: then
those are taken that fit the reflectance best above it, and not its projection, which spends some of
them on being 0 below.
"""

import numpy as np

from prt_core.basis import harmonics
from prt_core.errors import expect, expect_flag, expect_vectors, expect_whole

# Heights and turns of the directions over which reflectances are summed.
_HEIGHTS, _TURNS = 96, 192
# Above the horizon harmonics are nearly dependent: what is smaller than this in them is left out,
# so that coefficients stay small.
_DEPENDENT = 0.03


class HarmonicReflectance:
    """Reflectance times cosine, projected on the harmonics of the local frame.

    Parameters
    ----------
    reflectance_eval : callable
        See `dense_reflection`; of one isotropic material.
    order : int
        Degrees 0 to order - 1: order^2 coefficients.
    n_elevations : int
        Views for which they are made, evenly in the angle; others are interpolated.
    hemisphere : bool
        Fitted above the horizon alone, for light that was cut there; else projected.

    Attributes
    ----------
    table : (n_elevations, n_channels, order^2) float64
        For views along (sin t, 0, cos t), from straight above to the horizon.
    """

    def __init__(self, reflectance_eval, order=5, n_elevations=64, hemisphere=True):
        expect(callable(reflectance_eval), "reflectance_eval: expected a callable")
        self.order = expect_whole("order", order, 1, 16)
        n = expect_whole("n_elevations", n_elevations, 2, 4096)
        height, weight = np.polynomial.legendre.leggauss(_HEIGHTS)
        height, weight = (height + 1) / 2, weight / 2 * (2 * np.pi / _TURNS)
        turn = (np.arange(_TURNS) + 0.5) / _TURNS * 2 * np.pi
        radius = np.sqrt(1 - height**2)[:, None]
        incoming = np.stack(
            [radius * np.cos(turn), radius * np.sin(turn), height[:, None] + 0 * turn], axis=-1
        ).reshape(-1, 3)
        values, weight = harmonics(incoming, self.order), np.repeat(weight, _TURNS)[:, None]
        projected = values * weight * incoming[:, 2:]
        if expect_flag("hemisphere", hemisphere):
            # Eigenvalues are squares of the singular values of the harmonics on the hemisphere.
            size, ways = np.linalg.eigh(values.T @ (values * weight))
            kept = size > _DEPENDENT**2 * size[-1]
            projected = projected @ (ways[:, kept] / size[kept]) @ ways[:, kept].T
        self._step = np.pi / 2 / n
        rows = []
        for angle in (np.arange(n) + 0.5) * self._step:
            outgoing = np.array([[np.sin(angle), 0, np.cos(angle)]])
            rows.append(reflectance_eval(incoming, outgoing).T @ projected)
        self.table = np.array(rows)

    @property
    def n_channels(self):
        """Of the reflectance."""
        return self.table.shape[1]

    def vectors(self, outgoing):
        """Coefficients for views.

        Parameters
        ----------
        outgoing : (n, 3) float
            Unit vectors in the local frame, z along the normal.

        Returns
        -------
        (n, n_channels, order^2) float64
            0 for views from below the horizon.
        """
        outgoing = expect_vectors("outgoing", outgoing).reshape(-1, 3)
        x, y, z = outgoing.T
        place = np.arccos(np.clip(z, -1, 1)) / self._step - 0.5
        place = np.clip(place, 0, len(self.table) - 1)
        first = np.minimum(place.astype(int), len(self.table) - 2)
        part = (place - first)[:, None, None]
        rows = (1 - part) * self.table[first] + part * self.table[first + 1]
        rows *= (z > 0)[:, None, None]
        radius = np.hypot(x, y)
        along = radius > 0
        c = np.divide(x, radius, where=along, out=np.ones_like(x))
        s = np.divide(y, radius, where=along, out=np.zeros_like(x))
        result = rows.copy()
        cosine, sine = np.ones_like(c), np.zeros_like(c)
        for m in range(1, self.order):
            cosine, sine = c * cosine - s * sine, s * cosine + c * sine
            for degree in range(m, self.order):
                plus, minus = degree * (degree + 1) + m, degree * (degree + 1) - m
                a, b = rows[..., plus], rows[..., minus]
                result[..., plus] = cosine[:, None] * a - sine[:, None] * b
                result[..., minus] = sine[:, None] * a + cosine[:, None] * b
        return result

    @property
    def nbytes(self):
        """Of the table."""
        return self.table.nbytes
