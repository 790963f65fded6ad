"""Columns of a matrix that is made row by row: a blocked transpose through a file.

Rows are read in blocks, transposed in memory and written side by side, so that columns come back
whole. The file is as large as the matrix; memory holds a block.
"""

import tempfile

import numpy as np

from prt_core.compress.parallel import in_parallel
from prt_core.progress import Progress


class TransposedFile:
    """A temporary (n_columns, n_points) float32 file, gone when closed.

    Parameters
    ----------
    n_columns, n_points : int
    folder : str, optional
        Where; default: the system's for temporary files.
    """

    def __init__(self, n_columns, n_points, folder=None):
        self._file = tempfile.TemporaryFile(dir=folder)
        self.shape = n_columns, n_points
        self._file.truncate(4 * n_columns * n_points)

    def write(self, first, rows):
        """Put the (m, n_columns) rows of points first, first + 1 ... in their place."""
        columns = np.ascontiguousarray(rows.T, np.float32)
        for index, column in enumerate(columns):
            self._file.seek(4 * (index * self.shape[1] + first))
            self._file.write(column)

    def read(self, first, stop):
        """Columns (stop - first, n_points) float32."""
        self._file.seek(4 * first * self.shape[1])
        count = (stop - first) * self.shape[1]
        result = np.empty(count, np.float32)
        self._file.readinto(result)
        return result.reshape(stop - first, self.shape[1])

    def close(self):
        self._file.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def transpose_steps(rows, encode, file, order, memory):
    """Write encoded rows of all points into a `TransposedFile`; a generator of `Progress`.

    Parameters
    ----------
    rows : Rows
    encode : callable
        (n, n_directions, n_channels) block to (n, n_columns).
    file : TransposedFile
    order : (n_points,) int
        Point of each place in the columns.
    memory : int
        Bytes that blocks may take.
    """
    row_bytes = 4 * rows.n_directions * rows.n_channels
    # What is being made takes several copies of the rows, in two threads.
    chunk = max(8, min(256, int(memory / (12 * row_bytes))))
    wide = max(chunk, int(memory / 3 / (4 * file.shape[0])) // chunk * chunk)
    for first in range(0, len(order), wide):
        points = order[first : first + wide]
        held = np.empty((len(points), file.shape[0]), np.float32)
        parts = [slice(f, f + chunk) for f in range(0, len(points), chunk)]

        def one(part, points=points, held=held):
            held[part] = encode(rows.block(points[part]))

        for part, _ in zip(parts, in_parallel(one, parts), strict=True):
            yield Progress("rows", first + part.start, len(order))
        file.write(first, held)
