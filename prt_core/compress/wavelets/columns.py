"""Columns of a matrix that is made row by row: a blocked transpose through a file.

Rows are made in blocks, turned in memory and written as tiles, one after another; a few columns
are then read from all tiles. The file is as large as the matrix, memory holds one tile.
"""

import tempfile

import numpy as np

from prt_core.runtime.parallel import in_parallel
from prt_core.runtime.progress import Progress


class ColumnFile:
    """A temporary (n_columns, n_points) float32 matrix on disk, gone when closed.

    Parameters
    ----------
    n_columns, n_points : int
    width : int
        Points of a tile.
    folder : str, optional
        Where; default: the system's for temporary files.

    Attributes
    ----------
    energies : (n_columns,) float64
        Sum of the squares of what was written.
    """

    def __init__(self, n_columns, n_points, width, folder=None):
        self.shape = n_columns, n_points
        self._starts = range(0, n_points, max(1, min(width, n_points)))
        self.energies = np.zeros(n_columns)
        self._file = tempfile.TemporaryFile(dir=folder)

    @property
    def tiles(self):
        """(first, stop) points of each tile."""
        return [(first, min(first + self._starts.step, self.shape[1])) for first in self._starts]

    def write(self, first, tile):
        """Put the (n_columns, m) columns of points first, first + 1 ... in their place."""
        self.energies += np.einsum("cp,cp->c", tile, tile, dtype=np.float64)
        self._file.seek(4 * self.shape[0] * first)
        self._file.write(np.ascontiguousarray(tile, np.float32))

    def read(self, names):
        """Columns (len(names), n_points) float32; neighbouring ones are read together."""
        names = np.asarray(names)
        result = np.empty((len(names), self.shape[1]), np.float32)
        runs = np.split(np.arange(len(names)), np.flatnonzero(np.diff(names) != 1) + 1)
        for first, stop in self.tiles:
            for run in runs:
                part = np.empty((len(run), stop - first), np.float32)
                offset = self.shape[0] * first + int(names[run[0]]) * (stop - first)
                self._file.seek(4 * offset)
                self._file.readinto(part)
                result[run[0] : run[-1] + 1, first:stop] = part
        return result

    def close(self):
        """Remove the file."""
        self._file.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def transposed_steps(encode, n_columns, order, memory):
    """A `ColumnFile` of encoded rows; a generator of `Progress` that returns it.

    Parameters
    ----------
    encode : callable
        (n,) int points to their (n, n_columns) rows.
    n_columns : int
    order : (n_points,) int
        Point of each place in the columns.
    memory : int
        Bytes that blocks may take.
    """
    # What is being made takes several copies of the rows, in as many threads.
    chunk = max(8, min(256, int(memory / (16 * 4 * n_columns))))
    width = max(chunk, int(memory / 3 / (4 * n_columns)))
    file = ColumnFile(n_columns, len(order), width)
    try:
        for first, stop in file.tiles:
            tile = np.empty((n_columns, stop - first), np.float32)
            parts = [slice(f, min(f + chunk, stop)) for f in range(first, stop, chunk)]

            def one(part, first=first, tile=tile):
                tile[:, part.start - first : part.stop - first] = encode(order[part]).T

            for part, _ in zip(parts, in_parallel(one, parts), strict=True):
                yield Progress("rows", part.stop, len(order))
            file.write(first, tile)
    except BaseException:
        file.close()
        raise
    return file
