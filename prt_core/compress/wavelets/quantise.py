"""Coefficients in few bits (Cheslack-Postava et al. 2007, section 4.3)."""

import numpy as np

SCALINGS = ("root", "levels", "none")


def quantise(values, levels, bits, scaling, rng, size=None):
    """One column's coefficients as integers.

    Most coefficients are far smaller than the largest one and would fall into few steps. `root`
    quantises the root of the absolute value, so that steps are finer for small values. `levels`
    is the published way: coefficients of smooth pictures shrink by about half from a level to the
    next finer one, and are multiplied by 2^level.

    Parameters
    ----------
    values : (n,) float32
    levels : (n,) int
        Level of each, 0 the coarsest.
    bits : int
        With the sign.
    scaling : {"root", "levels", "none"}
    rng : numpy.random.Generator or None
        For dithering: rounding up as often as the rest is large, so that errors of many columns
        average out instead of adding up. None: to the nearest.
    size : float, optional
        As returned before, for more values of the column, none of them larger. Default: the one
        that just holds the largest value.

    Returns
    -------
    integers : (n,) int16
    size : float
        For `dequantise`.
    """
    if scaling == "root":
        scaled = np.sign(values) * np.sqrt(np.abs(values))
    else:
        scaled = np.ldexp(values, levels) if scaling == "levels" else values
    most = (1 << (bits - 1)) - 1
    if size is None:
        size = float(np.abs(scaled).max(initial=0)) / most or 1.0
    elif scaling == "root":
        size = size**0.5
    steps = scaled / np.float32(size)
    steps = np.rint(steps) if rng is None else np.floor(steps + rng.random(len(steps), np.float32))
    integers = np.clip(steps, -most, most).astype(np.int16)
    return integers, size**2 if scaling == "root" else size


def dequantise(integers, levels, size, scaling):
    """The values that integers stand for, float32."""
    values = np.asarray(integers, np.float32)
    if scaling == "root":
        values = values * np.abs(values)
    values = values * np.float32(size)
    return np.ldexp(values, -levels) if scaling == "levels" else values
