"""Large arrays: gone through in parts, and held as one value where all are the same."""

import numpy as np

_BYTES = 1 << 24


def parts_of(array):
    """Contiguous arrays whose bytes, one after the other, are those of `array` (...)."""
    array = np.atleast_1d(array)
    rows = max(1, _BYTES // max(1, array.itemsize * int(np.prod(array.shape[1:]))))
    for first in range(0, len(array), rows):
        yield np.ascontiguousarray(array[first : first + rows])


def held_once(array):
    """`array` (n,); where all its values are one it takes no room, and cannot be written to."""
    if not len(array) or any((part != array[:1]).any() for part in parts_of(array)):
        return array
    return np.broadcast_to(array[:1].copy(), array.shape)
