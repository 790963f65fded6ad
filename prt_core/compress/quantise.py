"""Coefficients in few bits (Cheslack-Postava et al. 2007, section 4.3)."""

import numpy as np


def quantise(values, scales, bits, rng):
    """One column's coefficients as integers.

    Coefficients of smooth pictures shrink by about half from a level to the next finer one;
    multiplying by 2^level lifts the fine ones over the quantiser's zero. Dithering makes the
    errors of many columns average out instead of adding up.

    Parameters
    ----------
    values : (n,) float32
    scales : (n,) int, or None
        Level of each, 0 the coarsest; None: all are quantised alike.
    bits : int
        With the sign.
    rng : numpy.random.Generator or None
        None: no dithering.

    Returns
    -------
    integers : (n,) int16
    size : float
        `value = integer * size / 2^scale`.
    """
    lifted = values if scales is None else np.ldexp(values, scales)
    most = (1 << (bits - 1)) - 1
    size = float(np.abs(lifted).max(initial=0)) / most or 1.0
    steps = lifted / np.float32(size)
    steps = np.rint(steps) if rng is None else np.floor(steps + rng.random(len(steps), np.float32))
    return np.clip(steps, -most, most).astype(np.int16), size


def dequantise(integers, scales, size):
    """The values that `quantise` stands for, float32."""
    values = integers * np.float32(size)
    return values if scales is None else np.ldexp(values, -scales)
