"""What fitted compressors hand to a store and take back: plain arrays and plain values, checked."""

import numpy as np

from prt_core.errors import PRTError, expect

_MOST = 1e15
_AGAIN = "it is damaged or of another version; compress again"


def array_of(state, name, shape, dtype, below=None):
    """An array of a state.

    Parameters
    ----------
    state : dict
    name : str
    shape : tuple of int or None
        None: any length.
    dtype : str
    below : int, optional
        Whole numbers from 0 to below - 1 only: they index something of that length.

    Raises
    ------
    PRTError
        Missing, of another shape or type, not finite, or pointing outside.
    """
    array = state.get(name)
    expect(isinstance(array, np.ndarray), f"compressed form: '{name}' is missing; {_AGAIN}")
    fits = array.ndim == len(shape) and all(
        n is None or n == m for n, m in zip(shape, array.shape, strict=True)
    )
    expect(
        fits and array.dtype == dtype,
        f"compressed form: '{name}' is {array.shape} {array.dtype}, expected {shape} {dtype}; "
        f"{_AGAIN}",
    )
    # Neither NaN nor so large that a product of two and a light would not be finite.
    good = array.dtype.kind != "f" or not array.size or float(np.abs(array).max()) <= _MOST
    if below is not None and array.size:
        good = array.min() >= 0 and array.max() < below
    expect(good, f"compressed form: '{name}' holds what it cannot; {_AGAIN}")
    return array


def value_of(state, name, kind):
    """A plain value of a state; `kind` converts it, and what it cannot convert is an error."""
    try:
        return kind(state[name])
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise PRTError(f"compressed form: '{name}' is wrong ({error!r}); {_AGAIN}") from error


def expect_state(condition, what):
    """Raise `PRTError` unless parts of a state fit each other."""
    expect(condition, f"compressed form: {what}; {_AGAIN}")
