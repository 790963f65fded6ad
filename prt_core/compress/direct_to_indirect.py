"""Direct-to-indirect transfer: what bounces make of any direct light, in wavelets over the points.

Lamps that move among the surfaces are no matter of directions; but what they bring straight to the
bake points goes on by one linear operator, whatever made it. Each row of it, all bounces summed,
says how much every point adds to one that is looked at. In wavelets over the points a row has few
coefficients that matter, and a frame is a transform of the direct light and a sparse product
(Hasan, Pellacini and Bala 2006).
"""

import numpy as np
import scipy.sparse as sp

from prt_core.errors import expect, expect_array, expect_indices, expect_kind, expect_number
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.threads import on_all_cores
from prt_core.transport import Transport
from prt_core.transport.bounce import MOST_RECEIVED, bounce_series
from prt_core.transport.sent import Sent, of_channels

# Rows that are made together.
_ROWS = 64


class DirectToIndirect:
    """Light between surfaces at some points, for any direct light at all of them.

    Parameters
    ----------
    transport : Transport
        With the light between surfaces (`gather`).
    basis : PointHaar or PointMultiwavelet
        Over the points of the transport.
    points : (n,) int, optional
        Those that are looked at; default: all. Each takes a solution of all bounces to prepare.
    kept : float
        Share of each row's coefficients that is kept.
    by_scale : bool
        Take the coefficients that are largest times the root of their patch's points: direct light
        is larger in those of large patches. Else those that are largest by themselves.

    Attributes
    ----------
    rows : list of (n, n_points) CSR float32
        For each channel; the same one where channels bounce alike.
    """

    def __init__(self, transport, basis, points=None, kept=0.02, by_scale=True):
        expect_kind("transport", transport, Transport)
        expect(transport.gather is not None, "transport: expected one with bounces; bake them")
        expect(
            getattr(basis, "n", None) == transport.n_points,
            f"basis: expected one of {transport.n_points} points, got one of "
            f"{getattr(basis, 'n', 'none')}",
        )
        self.basis, self.n_points = basis, transport.n_points
        points = np.arange(self.n_points) if points is None else points
        self.points = expect_indices("points", points, self.n_points)
        kept = expect_number("kept", kept, above=0, most=1)
        self.n_kept = max(1, round(kept * self.n_points))
        self._weights = np.ones(self.n_points, np.float32)
        if by_scale:
            # A patch of one scale less has four times as many points.
            scales = basis.scales(basis.depth)
            self._weights = np.float32(2.0) ** (scales.max() - scales).astype(np.float32)
        self.rows = []
        for channel in range(3):
            same = _same_channel(transport, channel)
            rows = self._channel(transport, channel) if same is None else self.rows[same]
            self.rows.append(rows)

    def _channel(self, transport, channel):
        transposed = transport.gather.T.tocsr()
        albedo = transport.bounced_albedo[:, [channel]]
        sends = of_channels(transport.bounces_by, [channel])
        back = sends.adjoint if isinstance(sends, Sent) else albedo.__mul__

        def one(first):
            points = self.points[first : first + _ROWS]
            start = np.zeros((self.n_points, len(points)), np.float32)
            start[points, np.arange(len(points))] = 1
            # w = e + A K^T w: how much the direct light of each point adds to these.
            weights, _ = bounce_series(
                lambda term: back(transposed @ term),
                start, albedo, transport.tolerance, transport.bounces,
            )  # fmt: skip
            return self._coded(np.ascontiguousarray((weights - start).T))

        with one_blas_thread():
            parts = on_all_cores(one, range(0, len(self.points), _ROWS))
        return sp.vstack(parts, "csr")

    def _coded(self, rows):
        """(m, n_points) CSR of rows: their wavelets that are kept."""
        coefficients = self.basis.forward(rows)
        if self.n_kept < self.n_points:
            order = np.abs(coefficients) * self._weights
            places = np.argpartition(-order, self.n_kept - 1, axis=1)[:, : self.n_kept]
        else:
            places = np.tile(np.arange(self.n_points), (len(rows), 1))
        places = np.sort(places, axis=1).astype(np.int32)
        values = np.take_along_axis(coefficients, places.astype(np.int64), axis=1)
        pointer = np.arange(len(rows) + 1) * self.n_kept
        shape = len(rows), self.n_points
        result = sp.csr_matrix((values.ravel(), places.ravel(), pointer), shape=shape)
        result.eliminate_zeros()
        return result

    def indirect(self, received):
        """What the points receive from surfaces.

        Parameters
        ----------
        received : (n_points, 3) float32
            Irradiance / pi that comes straight from where it is made (see `lamp_light`), at all
            points of the transport.

        Returns
        -------
        (n, 3) float32
            Irradiance / pi, at the points that are looked at.
        """
        received = self._expect_received(received)
        coefficients = self.basis.forward(np.ascontiguousarray(received.T))
        result = [rows @ column for rows, column in zip(self.rows, coefficients, strict=True)]
        return np.stack(result, axis=1)

    def product(self, received):
        """`indirect` and what came straight: (n, 3) float32, 0 or more.

        Parameters
        ----------
        received : (n_points, 3) float32
        """
        received = self._expect_received(received)
        return np.maximum(received[self.points] + self.indirect(received), 0)

    def _expect_received(self, received):
        shape = self.n_points, 3
        return expect_array("received", received, shape, np.float32, 0, MOST_RECEIVED)

    @property
    def nbytes(self):
        """Of the rows, each counted once."""
        unique = {id(rows): rows for rows in self.rows}.values()
        return sum(r.data.nbytes + r.indices.nbytes + r.indptr.nbytes for r in unique)


def _same_channel(transport, channel):
    """An earlier channel with which light bounces alike, or None."""
    albedo = transport.bounced_albedo
    if isinstance(transport.bounces_by, Sent):
        return None
    for earlier in range(channel):
        if np.array_equal(albedo[:, earlier], albedo[:, channel]):
            return earlier
    return None
