"""What goes wrong, said in one line: the thing, what was expected, what came, what to do."""

import numpy as np


class PRTError(ValueError):
    """Bad input, a bake that cannot be read, or a tool that is missing.

    The message is one line for a person: it names the argument or file, what was expected,
    what came instead and what to do about it.
    """


def expect(condition, message):
    """Raise `PRTError(message)` unless `condition` holds."""
    if not condition:
        raise PRTError(message)


def expect_array(name, value, shape, dtype=None):
    """`value` as an array of `shape` (None = any length) without NaN or infinity.

    Raises
    ------
    PRTError
        Names the argument, the shape expected and the shape that came.
    """
    array = np.asarray(value) if dtype is None else np.asarray(value, dtype)
    wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
    fits = array.ndim == len(shape) and all(
        n is None or n == m for n, m in zip(shape, array.shape, strict=True)
    )
    expect(fits, f"{name}: expected an array of shape {wanted}, got {array.shape}")
    if array.dtype.kind in "fc" and not np.isfinite(array).all():
        n_bad = int(array.size - np.isfinite(array).sum())
        raise PRTError(f"{name}: {n_bad} values are NaN or infinite; expected finite numbers only")
    return array
