"""Arrays of lobes: what parameters and directions have to be, and how colours lie in memory."""

import numpy as np

from prt_core.errors import PRTError, expect, expect_numbers, shown


def expect_parameter(name, value, least=None, most=None):
    """A parameter of a lobe: a number or an array of any shape, as float64, within bounds."""
    array = _numbers(name, value)
    if array.dtype.kind == "b" or not np.isfinite(array).all():
        raise PRTError(f"{name}: expected finite numbers only, got {shown(value)}")
    array = np.asarray(array, np.float64)
    low, high = array.min(initial=np.inf), array.max(initial=-np.inf)
    expect(least is None or low >= least, f"{name}: expected {least} or more, got {low:.4g}")
    expect(most is None or high <= most, f"{name}: expected {most} or less, got {high:.4g}")
    return array


def expect_colour(name, value, most=None):
    """A colour of a lobe: (..., n_channels) float64, 0 or more; a number has one channel."""
    array = np.atleast_1d(expect_parameter(name, value, 0, most))
    expect(array.shape[-1], f"{name}: expected one channel or more, got none")
    return array


def expect_directions(name, value):
    """(..., 3) of directions, float32 where they are, else float64."""
    array = _numbers(name, value)
    good = array.ndim > 0 and array.shape[-1] == 3
    expect(good, f"{name}: expected directions of shape (..., 3), got {array.shape}")
    array = array if array.dtype == np.float32 else np.asarray(array, np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        # One pass: of unit vectors no sum is infinite.
        good = np.isfinite(array.sum())
    expect(good, f"{name}: expected directions of length 1, got numbers that are not finite")
    return array


def expect_square(uv):
    """(..., 2) of numbers from 0 to 1, float32 where they are, else float64."""
    array = _numbers("uv", uv)
    good = array.ndim > 0 and array.shape[-1] == 2
    expect(good, f"uv: expected numbers of shape (..., 2), got {array.shape}")
    array = array if array.dtype == np.float32 else np.asarray(array, np.float64)
    good = not array.size or (array.min() >= 0 and array.max() <= 1)
    expect(good, "uv: expected numbers from 0 to 1")
    return array


def expect_both(incoming, outgoing, *parameters):
    """Incoming and outgoing directions of one type, whose leading axes broadcast.

    Parameters
    ----------
    incoming, outgoing : (..., 3) float
    *parameters : (...) array
        Of a lobe, one number for each direction: they have to broadcast as well.

    Returns
    -------
    incoming, outgoing : (..., 3) array
        Their components lie apart in memory (see `from_channels`).

    Raises
    ------
    PRTError
        Wrong shapes.
    """
    incoming = expect_directions("incoming", incoming)
    outgoing = expect_directions("outgoing", outgoing)
    _expect_axes("incoming, outgoing", (incoming, outgoing), parameters)
    kind = np.result_type(incoming, outgoing)
    apart = (np.ascontiguousarray(np.moveaxis(d, -1, 0), kind) for d in (incoming, outgoing))
    return tuple(np.moveaxis(planes, 0, -1) for planes in apart)


def expect_viewed(outgoing, uv, *parameters):
    """Outgoing directions and numbers of samples, of one type and with the same leading axes.

    Parameters
    ----------
    outgoing : (..., 3) float
    uv : (..., 2) float
    *parameters : (...) array
        See `expect_both`.

    Returns
    -------
    outgoing : (..., 3) array
    uv : (..., 2) array
    """
    outgoing, uv = expect_directions("outgoing", outgoing), expect_square(uv)
    shape = _expect_axes("outgoing, uv", (outgoing, uv), parameters)
    kind = np.result_type(outgoing, uv)
    outgoing = np.broadcast_to(outgoing.astype(kind, copy=False), (*shape, 3))
    return outgoing, np.broadcast_to(uv.astype(kind, copy=False), (*shape, 2))


def _expect_axes(names, directions, parameters):
    """The leading axes that directions have together, with parameters of one number each."""
    shapes = [array.shape[:-1] for array in directions]
    try:
        together = np.broadcast_shapes(*shapes)
    except ValueError as error:
        raise PRTError(
            f"{names}: expected leading axes that broadcast, got {shapes[0]} and {shapes[1]}; give "
            "one of them an axis of length 1"
        ) from error
    try:
        return np.broadcast_shapes(together, *(np.shape(values) for values in parameters))
    except ValueError as error:
        of = ", ".join(str(np.shape(values)) for values in parameters)
        raise PRTError(
            f"{names}: expected leading axes that broadcast with the parameters of the lobe, {of}, "
            f"got {together}; give parameters an axis of length 1 for each further one"
        ) from error


def from_channels(n_channels, channel):
    """An array (..., n_channels) of its channels, which lie apart in memory.

    Arithmetic over an innermost axis of three takes several times as long as over planes.

    Parameters
    ----------
    n_channels : int
    channel : callable
        Of an index: (...) array.

    Returns
    -------
    (..., n_channels) array
        A view of (n_channels, ...).
    """
    return np.moveaxis(np.stack([channel(k) for k in range(n_channels)]), 0, -1)


def channel_of(values, k):
    """Channel k (...) of values (..., n_channels), or the one there is."""
    return values[..., k if values.shape[-1] > 1 else 0]


def in_type_of(directions, *parameters):
    """Parameters in the precision of directions: a list of arrays."""
    return [np.asarray(values, directions.dtype) for values in parameters]


def both_above(incoming, outgoing):
    """(...) bool: whether light and viewer (..., 3) are above the horizon."""
    return (incoming[..., 2] > 0) & (outgoing[..., 2] > 0)


def mirrored(directions, normals):
    """Directions (..., 3) mirrored at normals (..., 3) of unit length."""
    cosine = (directions * normals).sum(axis=-1, keepdims=True)
    return 2 * cosine * normals - directions


def expect_fitting(**parameters):
    """Raise `PRTError` where `parameters` by name, (..., n_channels), do not broadcast."""
    shapes = [values.shape for values in parameters.values()]
    try:
        np.broadcast_shapes(*shapes)
    except ValueError as error:
        raise PRTError(
            f"{', '.join(parameters)}: expected shapes that broadcast, got "
            f"{', '.join(map(str, shapes))}"
        ) from error


def _numbers(name, value):
    """`expect_numbers`, at once for arrays of floats: lobes are asked for millions of times."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        return value
    return expect_numbers(name, value)
