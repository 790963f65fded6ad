"""K in files without a name, for scenes whose K does not fit into memory: read block by block.

They lie beside the bake, and go when nobody uses them any more.
"""

import threading

import numpy as np
import scipy.sparse as sp

from prt_core.runtime.files import file_without_name
from prt_core.runtime.threads import on_all_cores


class GatherFile:
    """(n_points, n_points) float32 in compressed sparse rows, written once, from top to bottom.

    Offers the product with a matrix and `shape`, as K in memory does; rows are added up in the
    same order, so the product is the same bit for bit.

    Parameters
    ----------
    folder : Path
        Where the files are made (see `file_without_name`).
    n_points : int
    """

    def __init__(self, folder, n_points):
        self.shape = n_points, n_points
        self._files = [file_without_name(folder) for _ in range(2)]
        self._lock = threading.Lock()
        self._pointers, self._first_row, self._first_entry = [], [0], [0]

    def append(self, rows):
        """Write the next rows, (n, n_points) CSR float32."""
        self._files[0].write(np.ascontiguousarray(rows.data, np.float32))
        self._files[1].write(np.ascontiguousarray(rows.indices, np.int32))
        self._pointers.append(rows.indptr.astype(np.int32))
        self._first_row.append(self._first_row[-1] + rows.shape[0])
        self._first_entry.append(self._first_entry[-1] + rows.nnz)

    def __matmul__(self, values):
        """(n_points, k) of values (n_points, k)."""
        result = np.empty((self.shape[0], *values.shape[1:]), np.result_type(values, np.float32))

        def one(block):
            part = slice(*self._first_row[block : block + 2])
            result[part] = self._block(block) @ values

        on_all_cores(one, range(len(self._pointers)))
        return result

    def mapped(self):
        """The same as a `scipy.sparse.csr_matrix` whose arrays are maps of the files."""
        n_entries = self._first_entry[-1]
        if not n_entries:
            return sp.csr_matrix(self.shape, dtype=np.float32)
        starts = zip(self._pointers, self._first_entry[:-1], strict=True)
        pointer = np.concatenate([[0], *(own[1:] + np.int64(first) for own, first in starts)])
        for file in self._files:
            file.flush()
        data, indices = (
            np.memmap(file, dtype, "r", shape=(n_entries,))
            for file, dtype in zip(self._files, (np.float32, np.int32), strict=True)
        )
        kind = np.int32 if n_entries < np.iinfo(np.int32).max else np.int64
        return sp.csr_matrix((data, indices, pointer.astype(kind)), shape=self.shape, copy=False)

    def _block(self, block):
        first, last = self._first_entry[block : block + 2]
        data, indices = np.empty(last - first, np.float32), np.empty(last - first, np.int32)
        with self._lock:
            for file, array in zip(self._files, (data, indices), strict=True):
                file.seek(4 * first)
                file.readinto(array)
        shape = len(self._pointers[block]) - 1, self.shape[1]
        return sp.csr_matrix((data, indices, self._pointers[block]), shape=shape)
