"""Independent pieces of array work on all cores, one BLAS thread each, in order."""

from collections import deque
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from prt_core.runtime.cores import n_cores
from prt_core.runtime.machine import one_blas_thread
from prt_core.runtime.threads import on_all_cores


def in_parallel(function, items):
    """Results of `function` for every item, in order; closing the generator ends the work.

    Pieces that fit a core's cache beat one BLAS call on all cores, and several BLAS threads in
    each of several Python threads get in each other's way. Few results wait at any time.
    """
    n_threads = n_cores()
    with one_blas_thread(), ThreadPoolExecutor(n_threads) as pool:
        waiting = deque()
        for item in items:
            waiting.append(pool.submit(function, item))
            if len(waiting) > 2 * n_threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


class SplitMatrix:
    """A CSR matrix whose products with dense ones use all cores: scipy's let go of Python's lock.

    Parameters
    ----------
    matrix : (n, m) CSR
    """

    def __init__(self, matrix):
        step = max(1, -(-matrix.shape[0] // (4 * n_cores())))
        firsts = range(0, max(matrix.shape[0], 1), step)
        self._parts = [matrix[first : first + step] for first in firsts]

    def __matmul__(self, dense):
        return np.concatenate(on_all_cores(lambda part: part @ dense, self._parts))
