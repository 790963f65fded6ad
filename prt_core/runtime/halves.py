"""Numbers in half the room: the upper half of a float32, which has its range and 8 bits.

Both ways are a shift, which is several times quicker than float16. Source: the bfloat16 format.
"""

import numpy as np

_HALF = np.uint32(0x8000)


def halves(values):
    """Float32 values, not negative, rounded to the nearest that 16 bits hold.

    Parameters
    ----------
    values : (...) float32

    Returns
    -------
    (...) uint16
    """
    bits = np.ascontiguousarray(values, np.float32).view(np.uint32)
    return ((bits + _HALF) >> np.uint32(16)).astype(np.uint16)


def wholes(values):
    """What `halves` made, `values` (...) uint16, as (...) float32."""
    return np.left_shift(values, 16, dtype=np.uint32).view(np.float32)
