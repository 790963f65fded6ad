"""The first two dimensions of Sobol's sequence."""

from functools import lru_cache

import numpy as np

_BITS = 30


@lru_cache(maxsize=32)
def sobol_points(power):
    """The first `2**power` points of the unit square, in Gray code order.

    The same values as `scipy.stats.qmc.Sobol(2, scramble=False)`, whose module takes longer to
    import than the rest of this package.

    Parameters
    ----------
    power : int
        0 to 30.

    Returns
    -------
    (2**power, 2) float64
        In [0, 1), multiples of `2**-power`.

    Source: Bratley and Fox 1988, algorithm 659; the second dimension's polynomial is x + 1.
    """
    index = np.arange(1 << power)
    gray = index ^ (index >> 1)
    points = np.zeros((len(index), 2), np.int64)
    second = 1 << (_BITS - 1)
    for bit in range(power):
        directions = 1 << (_BITS - 1 - bit), second
        points ^= (gray >> bit & 1)[:, None] * np.array(directions)
        second ^= second >> 1
    points = points / (1 << _BITS)
    points.flags.writeable = False
    return points
