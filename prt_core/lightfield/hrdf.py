"""Hemispherical radiance distributions (HRDFs): the table of one point, and how it is looked up.

An HRDF holds what leaves a point of a surface in m1 x m2 directions of its tangent frame, cells of
equal solid angle of the concentric map (Miandji et al. 2013, section 1). The border of the square
is the horizon: no cell has a neighbour beyond it, and none wraps around.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from prt_core.errors import expect_array, expect_numbers, expect_whole
from prt_core.sphere import hemisphere_directions, hemisphere_solid_angle

# Rows or columns, at most.
MOST = 256
# Luma of Rec.709 and the scales of its chroma (ITU-R BT.709), of linear radiance of any size.
_LUMA = np.array([0.2126, 0.7152, 0.0722])
_BLUE, _RED = 2 * (1 - _LUMA[2]), 2 * (1 - _LUMA[0])
TO_YCBCR = np.stack([_LUMA, (np.eye(3)[2] - _LUMA) / _BLUE, (np.eye(3)[0] - _LUMA) / _RED], axis=1)
FROM_YCBCR = np.linalg.inv(TO_YCBCR)


@dataclass(frozen=True)
class HRDFLayout:
    """Which direction of the tangent frame each cell of an HRDF looks in.

    Cell (row, column) of `rows` x `columns` is at u = (column + 0.5) / columns and
    v = (row + 0.5) / rows of `hemisphere_directions`; its index is row * columns + column.

    Parameters
    ----------
    rows, columns : int
        m1 and m2 of the paper, 1 to 256 each.
    """

    rows: int = 32
    columns: int = 16

    def __post_init__(self):
        for name in ("rows", "columns"):
            object.__setattr__(self, name, expect_whole(name, getattr(self, name), 1, MOST))

    @property
    def shape(self):
        """(rows, columns)."""
        return self.rows, self.columns

    @property
    def n_cells(self):
        """Directions of an HRDF."""
        return self.rows * self.columns

    @property
    def solid_angle(self):
        """Of each cell, in steradians: all have the same."""
        return hemisphere_solid_angle(self.columns, self.rows)

    @cached_property
    def directions(self):
        """(n_cells, 3) float64: the middles of cells in the tangent frame, z along the normal."""
        u = (np.arange(self.columns) + 0.5) / self.columns
        v = (np.arange(self.rows) + 0.5) / self.rows
        return hemisphere_directions(*np.meshgrid(u, v)).reshape(-1, 3)

    def places(self, directions):
        """Where directions are among the middles of the cells.

        Parameters
        ----------
        directions : (..., 3) float
            Unit vectors in the tangent frame. Those below the facet count as their nearest on the
            horizon.

        Returns
        -------
        row, column : (...) float32
            0 at the middle of the first cell, `rows` - 1 and `columns` - 1 at that of the last.
            What is nearer to the border than any middle is held there.
        """
        x, y, z = np.moveaxis(np.asarray(directions, np.float32), -1, 0)
        return self.places_of(x, y, z)

    def places_of(self, x, y, z):
        """(...) float32 row and column, as `places` gives them, of coordinates x, y, z (float32).

        The concentric map in as few passes as a frame of an interactive view can pay; it is
        `hemisphere_square` to rounding.
        """
        wide, high = np.abs(x), np.abs(y)
        more = np.maximum(wide, high)
        # An angle of atan2(0, 0) at the pole is 0 and multiplied by a radius of 0.
        share = np.arctan2(np.minimum(wide, high), more)
        radius = np.sqrt(np.clip(1 - z, 0, 1))
        share *= np.float32(4 / np.pi)
        share *= radius
        sideways = wide == more
        row = np.copysign(np.where(sideways, share, radius), y)
        column = np.copysign(np.where(sideways, radius, share), x)
        return _between(row, self.rows), _between(column, self.columns)

    def nearest(self, directions):
        """The cell that each direction is in.

        Parameters
        ----------
        directions : (..., 3) float
            As in `places`.

        Returns
        -------
        (...) int32
        """
        row, column = self.places(directions)
        # Half a cell from a middle is the next cell's border: whole numbers round up, as floor
        # of the place in the square does.
        row = np.minimum(np.floor(row + 0.5), self.rows - 1)
        column = np.minimum(np.floor(column + 0.5), self.columns - 1)
        return (row * self.columns + column).astype(np.int32)

    def bilinear(self, directions):
        """Cells around directions, and their weights.

        Parameters
        ----------
        directions : (..., 3) float
            As in `places`.

        Returns
        -------
        cells : (..., 4) int32
            Two beside each other, and the two of the next row. They coincide where there is one
            row or column only.
        weights : (..., 4) float32
            Sum to 1.
        """
        (row, up), (column, right) = (
            split_places(place, count)
            for place, count in zip(self.places(directions), self.shape, strict=True)
        )
        first = row * self.columns + column
        beside, below = int(self.columns > 1), self.columns * int(self.rows > 1)
        cells = np.stack([first, first + beside, first + below, first + below + beside], axis=-1)
        return cells, bilinear_weights(up, right)


def _between(coordinate, count):
    """A coordinate from -1 to 1 of the square as a place among `count` middles of cells."""
    coordinate *= np.float32(count / 2)
    coordinate += np.float32(count / 2 - 0.5)
    return np.clip(coordinate, 0, count - 1, out=coordinate)


def split_places(places, count):
    """The first of the two neighbours of places, (...) int32, and the share of the second.

    Parameters
    ----------
    places : (...) float32
        From 0 to `count` - 1; they become the shares.
    count : int
        Neighbours in all.
    """
    first = places.astype(np.int32)
    np.minimum(first, max(count - 2, 0), out=first)
    places -= first
    return first, places


def bilinear_weights(up, right):
    """(..., 4) float32 of two shares of the next row and column: none, right, up, both."""
    weights = np.empty((*up.shape, 4), np.float32)
    both = up * right
    weights[..., 3] = both
    np.subtract(up, both, out=weights[..., 2])
    np.subtract(right, both, out=weights[..., 1])
    np.subtract(1 - up, weights[..., 1], out=weights[..., 0])
    return weights


def to_ycbcr(rgb):
    """(..., 3) float32 luma and two chroma differences of linear Rec.709 radiance `rgb`.

    Linear, so that light keeps adding up: Cb and Cr are 0 for grey of any strength and may be as
    large as the radiance (ITU-R BT.709 without its transfer curve).
    """
    rgb = expect_numbers("rgb", rgb)
    rgb = expect_array("rgb", rgb, (*(None,) * max(rgb.ndim - 1, 0), 3), np.float32)
    return rgb @ TO_YCBCR.astype(np.float32)


def to_rgb(ycbcr):
    """(..., 3) float32 linear Rec.709 radiance of (..., 3) `ycbcr`: undo `to_ycbcr`."""
    ycbcr = expect_numbers("ycbcr", ycbcr)
    ycbcr = expect_array("ycbcr", ycbcr, (*(None,) * max(ycbcr.ndim - 1, 0), 3), np.float32)
    return ycbcr @ FROM_YCBCR.astype(np.float32)
