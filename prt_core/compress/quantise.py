"""Coefficients in few bits (Cheslack-Postava et al. 2007, section 4.3)."""

import numpy as np


def quantise(values, lifts, bits, rng):
    """One column's coefficients as integers.

    Coefficients of smooth pictures shrink by about half from a level to the next finer one;
    multiplying by 2^level lifts the fine ones over the quantiser's zero. Dithering makes the
    errors of many columns average out instead of adding up.

    Parameters
    ----------
    values : (n,) float32
    lifts : (n,) float32
        Factors, 2^level; ones where coefficients are to be quantised alike.
    bits : int or None
        With the sign; None: as they are.
    rng : numpy.random.Generator or None
        None: no dithering.

    Returns
    -------
    integers : (n,) int16, or float32
    size : float
        `value = integer * size / lift`.
    error : float
        Squared, of all values.
    """
    if bits is None or not len(values):
        return values, 1.0, 0.0
    lifted = values * lifts
    most = (1 << (bits - 1)) - 1
    size = float(np.abs(lifted).max()) / most or 1.0
    steps = lifted / size
    steps = np.rint(steps) if rng is None else np.floor(steps + rng.random(len(steps)))
    steps = np.clip(steps, -most, most)
    error = (steps * size / lifts - values).astype(np.float64)
    return steps.astype(np.int16), size, float(error @ error)
