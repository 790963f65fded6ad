"""A light field as it is looked at: views from a table that was decoded once.

An interactive view wants all points in a few milliseconds. The radiance between four directions is
a row of four weights times a table of all cells, so a view is one sparse product; the weights are
the concentric map of the view in each point's tangent frame.
"""

import numpy as np
from scipy.sparse import csr_array

from prt_core.errors import expect_array, expect_number
from prt_core.lightfield.hrdf import bilinear_weights, split_places
from prt_core.runtime.threads import on_all_cores

# Points of a block: fewer of them pay more for each call than their weights gain from a cache.
_BLOCK = 1 << 14
# Points that are decoded at once.
_DECODED = 2048


class Viewer:
    """One mixture of a field's lights, ready for views.

    Parameters
    ----------
    field : SurfaceLightField
    weights : (n_lights,) or (n_lights, n_channels) float, optional
        Factors of the lights; default: 1.
    most_bytes : int
        Of memory for the decoded table, 12 for each point and cell. Where it does not fit, views
        are made from the coefficients: the same values, in several times as long.

    Attributes
    ----------
    is_decoded : bool
    """

    def __init__(self, field, weights=None, most_bytes=1 << 30):
        expect_number("most_bytes", most_bytes, least=0)
        self._field, self._weights = field, field.expect_weights(weights)
        layout, n_points = field.layout_, field.n_points_
        self.is_decoded = 12 * n_points * layout.n_cells <= most_bytes
        self._frames = np.ascontiguousarray(field.frames_.transpose(1, 2, 0))
        if self.is_decoded:
            self._table = np.empty((n_points, layout.n_cells, 3), np.float32)
            for first in range(0, n_points, _DECODED):
                part = np.arange(first, min(first + _DECODED, n_points))
                decoded = field.decode(part, self._weights)
                self._table[part] = decoded.reshape(len(part), -1, 3)

    def toward(self, directions):
        """Radiance that leaves each point, between the four nearest directions that are kept.

        Parameters
        ----------
        directions : (n_points, 3) float
            Unit vectors in the world, from the points to the viewer.

        Returns
        -------
        (n_points, 3) float32
        """
        shape = self._field.n_points_, 3
        directions = expect_array("directions", directions, shape, np.float32)
        if not self.is_decoded:
            return self._field.toward(directions, self._weights)
        result = np.empty(shape, np.float32)

        # Cells of a block are counted in int32.
        count = max(1, min(_BLOCK, (1 << 30) // self._field.layout_.n_cells))

        def block(first):
            part = slice(first, min(first + count, len(result)))
            result[part] = self._between(directions[part], part)

        on_all_cores(block, range(0, len(result), count))
        return result

    def _between(self, directions, part):
        rows = between_cells(self._field.layout_, self._frames[:, :, part], directions)
        return rows @ self._table[part].reshape(-1, 3)


def between_cells(layout, frames, directions):
    """Rows of four weights that times a table of cells give radiance towards directions.

    Parameters
    ----------
    layout : HRDFLayout
    frames : (3, 3, n) float32
        Axis of the frame, axis of the world, point.
    directions : (n, 3) float32

    Returns
    -------
    (n, n * n_cells) sparse float32
        With the cells of the first point first.
    """
    local = in_frames(frames, directions)
    (row, up), (column, right) = (
        split_places(place, count)
        for place, count in zip(layout.places_of(*local), layout.shape, strict=True)
    )
    n = len(row)
    beside, below = int(layout.columns > 1), layout.columns * int(layout.rows > 1)
    cells = np.empty((n, 4), np.int32)
    row *= np.int32(layout.columns)
    row += column
    row += np.arange(0, n * layout.n_cells, layout.n_cells, dtype=np.int32)
    for k, offset in enumerate((0, beside, below, below + beside)):
        np.add(row, np.int32(offset), out=cells[:, k])
    weights = bilinear_weights(up, right).ravel()
    starts = np.arange(0, 4 * n + 1, 4, dtype=np.int32)
    return csr_array((weights, cells.ravel(), starts), shape=(n, n * layout.n_cells))


def in_frames(frames, directions):
    """Coordinates of directions along tangents and normal.

    Parameters
    ----------
    frames : (3, 3, n) float32
        Axis of the frame, axis of the world, point.
    directions : (n, 3) float32

    Returns
    -------
    list of (n,) float32
    """
    x, y, z = directions.T
    local = []
    for axis in frames:
        along = axis[0] * x
        along += axis[1] * y
        along += axis[2] * z
        local.append(along)
    return local
