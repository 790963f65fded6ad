"""Which parts of wide lamps places see: their shares, in cells of the square of samples.

What a place receives of a lamp says how much of it is hidden; a highlight also shows where. Shadow
rays know that: each goes to a place on the lamp, and those of one cell have a share together.
"""

import numpy as np

# Cells along an edge for so many samples a point and more: about one in each.
_SIDES = ((256, 16), (64, 8))


class SeenCells:
    """How much points see of the cells of a lamp.

    Parameters
    ----------
    row : (n_points,) int32
        Of the table; -1 where all of the lamp is seen, or none of it is in question, -2 where
        nothing is.
    table : (m, side, side) uint8
        Shares in 255ths, of those who see a part.
    """

    def __init__(self, row, table):
        self._row = row
        side = table.shape[1]
        ends = np.repeat(np.array([0, 255], np.uint8), side * side).reshape(2, side, side)
        # Negative rows count from the end.
        self._table = np.concatenate([table, ends])

    @property
    def nbytes(self):
        """Of the arrays."""
        return self._row.nbytes + self._table.nbytes

    def of(self, points):
        """(k, side, side) float32: shares of the cells that points by number (k,) see, 0 to 1."""
        return self._table[self._row[points]] * np.float32(1 / 255)

    def between(self, points, weights):
        """The same of places between points (k, 3), by their weights (k, 3).

        None where no place has a point that sees a part.
        """
        partly = np.flatnonzero((self._row[points] >= 0).any(axis=1))
        if not len(partly):
            return None
        shares = np.ones((len(points), *self._table.shape[1:]), np.float32)
        shares[partly] = sum(
            self.of(points[partly, corner]) * weights[partly, corner, None, None]
            for corner in range(points.shape[1])
        )
        return shares


class LampCells:
    """Takes note of shadow rays, a block of points after the other.

    Parameters
    ----------
    wanted : (n_points,) bool
        Whose cells are asked for; others count as those who see all.
    side : int
        Cells along an edge (see `cells_along`).
    """

    def __init__(self, wanted, side):
        self._wanted, self._side = wanted, side
        self._row = np.full(len(wanted), -1, np.int32)
        self._tables, self._count = [], 0

    def begin(self, block):
        """The points of a slice are next."""
        self._block = block
        self._sums, self._counts = np.zeros((2, (block.stop - block.start) * self._side**2))

    def take(self, point, uv, share):
        """Rays of points (n,), ascending, towards `uv` (n, 2) of the lamp: what share arrives."""
        if not len(point):
            return
        cell = np.minimum((uv * self._side).astype(np.int64), self._side - 1)
        first, last = point[0] - self._block.start, point[-1] + 1 - self._block.start
        place = ((point - point[0]) * self._side + cell[:, 0]) * self._side + cell[:, 1]
        some = slice(first * self._side**2, last * self._side**2)
        self._sums[some] += np.bincount(place, share, some.stop - some.start)
        self._counts[some] += np.bincount(place, minlength=some.stop - some.start)

    def end(self):
        """All rays of the block are cast."""
        shape = -1, self._side, self._side
        sums, counts = self._sums.reshape(shape), self._counts.reshape(shape)
        cast = counts.sum(axis=(1, 2))
        mean = sums.sum(axis=(1, 2)) / np.maximum(cast, 1)
        row = self._row[self._block]
        row[(cast > 0) & (mean == 0)] = -2
        partly = np.flatnonzero((mean > 0) & (mean < 1) & self._wanted[self._block])
        row[partly] = self._count + np.arange(len(partly))
        self._count += len(partly)
        shares = _shares(sums[partly], counts[partly])
        # What is seen at all stays so.
        shares = np.where(shares > 0, np.maximum(np.rint(255 * shares), 1), 0)
        self._tables.append(shares.astype(np.uint8))

    def seen(self):
        """The `SeenCells`; None where every point sees all of the lamp or nothing."""
        if not self._count:
            return None
        return SeenCells(self._row, np.concatenate(self._tables))


def _shares(sums, counts):
    """Of cells (k, side, side); those that no ray went to have the share of those around."""
    side = sums.shape[1]
    shares = np.zeros_like(sums)
    for size in (side, 4, 2, 1):
        own, n = (
            array.reshape(-1, side // size, size, side // size, size).sum(axis=(2, 4))
            for array in (sums, counts)
        )
        own = np.divide(own, n, out=np.zeros_like(own), where=n > 0)
        own, known = (a.repeat(size, axis=1).repeat(size, axis=2) for a in (own, n > 0))
        shares = np.where(known, own, shares)
    return shares


def cells_along(lamp, n_samples):
    """Cells along an edge that shadow rays of a `Lamp` can tell apart; 0 where it has none."""
    if lamp.kind == "pixels" or lamp.is_small or not lamp.casts_shadow:
        return 0
    return next((side for least, side in _SIDES if n_samples >= least), 0)


def warped(uv, shares):
    """Samples that fall where a lamp is seen.

    Parameters
    ----------
    uv : (k, m, 2) float in [0, 1)
        Well spread.
    shares : (k, side, side) float
        Of cells, by the first of the coordinates and then the second; where all are the same
        samples stay.

    Returns
    -------
    (k, m, 2) float
        As densely as the shares are.

    Source: Pharr, Jakob and Humphreys 2023, section A.5.6 (piecewise-constant 2D distributions).
    """
    some = np.flatnonzero((shares != shares[:, :1, :1]).any(axis=(1, 2)))
    shares, result = shares[some].astype(np.float64), uv.copy()
    row, u = _within(uv[some, :, 0], shares.sum(axis=2)[:, None])
    _, v = _within(uv[some, :, 1], shares[np.arange(len(some))[:, None], row])
    result[some] = np.stack([u, v], axis=-1)
    return result


def _within(u, weights):
    """The cell of each number (k, m), by weights (k, 1 or m, side), and the place in 0..1."""
    side = weights.shape[-1]
    ends = np.cumsum(weights, axis=-1)
    wanted = (u * ends[..., -1])[..., None]
    cell = np.minimum((ends <= wanted).sum(axis=-1), side - 1)[..., None]
    full = np.broadcast_shapes(ends.shape, (*u.shape, side))
    ends, weights = np.broadcast_to(ends, full), np.broadcast_to(weights, full)
    weight = np.take_along_axis(weights, cell, axis=-1)
    start = np.take_along_axis(ends, cell, axis=-1) - weight
    inside = np.clip((wanted - start) / np.maximum(weight, 1e-30), 0, 1 - 1e-9)
    return cell[..., 0], ((cell + inside) / side)[..., 0]
