"""Many small arrays as one: a store keeps each array in files of its own, which cost more."""

import math

import numpy as np

from prt_core.compress.state import array_of, expect_state, value_of

TYPES = ("int8", "uint8", "int16", "uint16", "int32", "float32")


def joined(arrays):
    """One array of all, and where each is in it.

    Parameters
    ----------
    arrays : dict of str to array of any shape
        Of the types in `TYPES`.

    Returns
    -------
    data : (n_bytes,) uint8
    index : list of [name, type, shape]
        In the order of the bytes.
    """
    index = [[name, str(array.dtype), list(array.shape)] for name, array in arrays.items()]
    parts = [np.ascontiguousarray(array).view(np.uint8).ravel() for array in arrays.values()]
    return np.concatenate(parts), index


def split(state):
    """The arrays that `joined` made one, by name.

    Parameters
    ----------
    state : dict
        With its results, `data` and `index`.

    Returns
    -------
    dict of str to array of any shape

    Raises
    ------
    PRTError
        The data are not as long as the index says, or hold what they cannot.
    """
    data = array_of(state, "data", (None,), "uint8")
    arrays, at = {}, 0
    for name, kind, shape in value_of(state, "index", _checked):
        n_bytes = math.prod(shape) * np.dtype(kind).itemsize
        expect_state(at + n_bytes <= len(data), "its data are shorter than described")
        arrays[name] = data[at : at + n_bytes].copy().view(kind).reshape(shape)
        at += n_bytes
    expect_state(at == len(data), "its data are longer than described")
    return arrays


def _checked(index):
    entries = [(str(name), str(kind), [int(n) for n in shape]) for name, kind, shape in index]
    if any(kind not in TYPES or min(shape, default=0) < 0 for _, kind, shape in entries):
        raise ValueError("an array of no known kind")
    return entries
