"""Radiance of each light of a field by itself towards a view, from tables decoded once.

Where lamps are dimmed and given another colour all the time, their mixture must cost nothing. A
table that has the lights of a cell side by side gives all of them for one look-up: what takes time
is to find the cells, not to read a few more numbers there.
"""

import numpy as np

from prt_core.errors import expect_array, expect_number
from prt_core.lightfield.viewer import between_cells
from prt_core.runtime.threads import on_all_cores

# Points of a block of a view (see `viewer`): their cells are counted in int32.
_BLOCK = 1 << 14
# A number of float16, but no float16: others that it divides would become such.
_LARGEST = float(np.finfo(np.float16).max)


class LightTables:
    """All lights of a field, ready for views.

    Parameters
    ----------
    field : SurfaceLightField or CapturedField
        Anything with `n_points_`, `n_lights_`, `layout_`, `frames_` and `decode`.
    dtype : type
        float32, or float16 for half of the memory: every number within 0.05 % of what it was,
        down to a billionth of the light's largest.
    at_once : int
        Points that are decoded at once.
    """

    def __init__(self, field, dtype=np.float32, at_once=2048):
        layout, n_points, n_lights = field.layout_, field.n_points_, field.n_lights_
        self._layout, self._shape = layout, (n_points, n_lights, 3)
        self._frames = np.ascontiguousarray(field.frames_.transpose(1, 2, 0))
        self._table = np.empty((n_points, layout.n_cells, n_lights, 3), dtype)
        self._scales = np.ones((n_lights, 1), np.float32)
        parts = [slice(n, min(n + at_once, n_points)) for n in range(0, n_points, at_once)]
        for light in range(n_lights):
            alone = np.eye(n_lights, dtype=np.float32)[light]
            if dtype == np.float16:
                largest = max(float(np.abs(field.decode(part, alone)).max()) for part in parts)
                self._scales[light] = (largest or 1.0) / _LARGEST
            for part in parts:
                decoded = field.decode(part, alone).reshape(-1, layout.n_cells, 3)
                self._table[part, :, light] = decoded / self._scales[light]

    @staticmethod
    def dtype_within(field, most_bytes):
        """float32, float16, or None where neither fits into so many bytes."""
        expect_number("most_bytes", most_bytes, least=0)
        size = 3 * field.n_points_ * field.layout_.n_cells * field.n_lights_
        sizes = ((kind, size * np.dtype(kind).itemsize) for kind in (np.float32, np.float16))
        return next((kind for kind, n_bytes in sizes if n_bytes <= most_bytes), None)

    @property
    def nbytes(self):
        """Bytes of the tables."""
        return self._table.nbytes

    def each_toward(self, directions):
        """Radiance of each light towards a view, between the four nearest directions.

        Parameters
        ----------
        directions : (n_points, 3) float
            Unit vectors in the world, from the points to the viewer.

        Returns
        -------
        (n_points, n_lights, 3) float32
        """
        shape = self._shape[0], 3
        directions = expect_array("directions", directions, shape, np.float32)
        result = np.empty(self._shape, np.float32)

        def block(first):
            part = slice(first, min(first + _BLOCK, len(result)))
            result[part] = self._between(directions[part], part)

        on_all_cores(block, range(0, len(result), _BLOCK))
        return result

    def _between(self, directions, part):
        rows = between_cells(self._layout, self._frames[:, :, part], directions)
        n, (_, n_lights, _) = len(directions), self._shape
        table = self._table[part].reshape(-1, 3 * n_lights)
        if table.dtype == np.float32:
            return (rows @ table).reshape(n, n_lights, 3)
        cells = table[rows.indices.reshape(n, 4)].astype(np.float32)
        mixed = np.einsum("nk,nkc->nc", rows.data.reshape(n, 4), cells)
        return mixed.reshape(n, n_lights, 3) * self._scales
