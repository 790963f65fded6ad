"""Large arrays, gone through in parts: what is made of each is gone before the next one."""

import numpy as np

_BYTES = 1 << 24


def parts_of(array):
    """Contiguous arrays whose bytes, one after the other, are those of `array` (...)."""
    array = np.atleast_1d(array)
    rows = max(1, _BYTES // max(1, array.itemsize * int(np.prod(array.shape[1:]))))
    for first in range(0, len(array), rows):
        yield np.ascontiguousarray(array[first : first + rows])
