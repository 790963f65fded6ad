"""What goes wrong, said in one line: the thing, what was expected, what came, what to do."""

import errno
import math
import numbers
import os
from contextlib import contextmanager
from pathlib import Path

import numpy as np

_SHOWN = 60
# What a person can do about what the system refuses.
_SPACE = "free some space there, or choose another disk"
_FOLDER = "choose another folder, or ask for the right to write there"
_REMEDIES = {
    errno.ENOSPC: _SPACE,
    errno.EDQUOT: _SPACE,
    errno.EFBIG: "the disk takes no file so large; choose another",
    errno.EROFS: _FOLDER,
    errno.EACCES: _FOLDER,
    errno.EPERM: _FOLDER,
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ENOENT: "make its folder first, or correct the name",
    errno.ENOTDIR: "a file is in the way of a folder; correct the path",
    errno.EISDIR: "a folder is in the way; choose another name",
    errno.EEXIST: "something is in the way; choose another name",
    errno.ENOTEMPTY: "something is in the way; choose another name",
    errno.EMFILE: "close other files, or raise the limit with 'ulimit -n'",
}


class PRTError(ValueError):
    """Bad input, a bake that cannot be read, or a tool that is missing.

    The message is one line for a person: it names the argument or file, what was expected,
    what came instead and what to do about it.
    """


@contextmanager
def system_errors(path=None):
    """What the system refuses inside (a full disk, no right to write, no memory) as `PRTError`.

    Parameters
    ----------
    path : str or Path, optional
        Named in the message; default: the file the system names.
    """
    try:
        yield
    except MemoryError as error:
        where = "memory" if path is None else path
        raise PRTError(
            f"{where}: not enough memory ({shown(str(error) or 'of any size')}); take fewer "
            "points, directions or pixels, or a machine with more"
        ) from error
    except OSError as error:
        where = path or error.filename or "the system"
        reason = (error.strerror or str(error) or type(error).__name__).lower()
        remedy = _REMEDIES.get(error.errno)
        line = f"{where}: {reason}" + (f"; {remedy}" if remedy else "")
        raise PRTError(" ".join(line.split())) from error


def shown(value):
    """A value in a message: on one line, and not longer than that."""
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of shape {value.shape} and type {value.dtype}"
    try:
        text = " ".join(repr(value).split())
    except Exception:
        text = f"a {type(value).__name__}"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


def expect(condition, message):
    """Raise `PRTError(message)` unless `condition` holds."""
    if not condition:
        raise PRTError(message)


def expect_kind(name, value, kinds, wanted=None):
    """`value`, where it is of one of the classes `kinds`; `wanted` says what these are."""
    kinds = kinds if isinstance(kinds, tuple) else (kinds,)
    wanted = wanted or " or ".join(f"a {kind.__name__}" for kind in kinds)
    expect(isinstance(value, kinds), f"{name}: expected {wanted}, got {shown(value)}")
    return value


def expect_one_of(name, value, choices):
    """`value`, where it is one of the texts `choices`."""
    good = isinstance(value, str) and value in choices
    expect(good, f"{name}: expected one of {', '.join(choices)}, got {shown(value)}")
    return value


def expect_flag(name, value):
    """`value` as a bool."""
    expect(
        isinstance(value, bool | np.bool_), f"{name}: expected True or False, got {shown(value)}"
    )
    return bool(value)


def expect_number(name, value, least=None, most=None, above=None, below=None):
    """`value` as a float that is finite and within bounds; neither a bool nor text."""
    try:
        number = float(value) if _is_real(value) else math.nan
    except OverflowError:
        number = math.inf
    good = math.isfinite(number) and _within(number, least, most, above, below)
    bounds = _bounds(least, most, above, below)
    expect(good, f"{name}: expected a number{bounds}, got {shown(value)}")
    return number


def expect_whole(name, value, least=0, most=None):
    """`value` as an int within bounds; neither a bool nor text, nor a float."""
    whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    good = whole and _within(value, least, most, None, None)
    bounds = _bounds(least, most, None, None)
    expect(good, f"{name}: expected a whole number{bounds}, got {shown(value)}")
    return int(value)


def expect_pair(name, value, least=1, most=None):
    """Two whole numbers within bounds, such as rows and columns, as a tuple of ints."""
    pair = tuple(value) if isinstance(value, list | tuple | np.ndarray) else ()
    expect(len(pair) == 2, f"{name}: expected two whole numbers, got {shown(value)}")
    return tuple(expect_whole(name, number, least, most) for number in pair)


def expect_seed(seed):
    """A seed of random numbers as an int."""
    return expect_whole("seed", seed, 0, (1 << 32) - 1)


def expect_path(name, value):
    """`value` as a `Path`, where it is the text of one or a path."""
    good = isinstance(value, str | os.PathLike) and isinstance(os.fspath(value), str)
    text = os.fspath(value) if good else ""
    expect(good and text.strip(), f"{name}: expected a path, got {shown(value)}")
    expect("\0" not in text, f"{name}: a path cannot hold a zero byte, got {shown(value)}")
    return Path(text)


def expect_array(name, value, shape, dtype=None, least=None, most=None):
    """`value` as an array of `shape` (None = any length) of finite numbers.

    Parameters
    ----------
    name : str
    value : array_like
    shape : tuple of int or None
    dtype : numpy type, optional
        Default: that of the value. Whole numbers are not made of fractions.
    least, most : float, optional
        Bounds of all values.

    Raises
    ------
    PRTError
        Names the argument, the shape expected and the shape that came.
    """
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):
        array = np.asarray(None)
    kind = array.dtype.kind
    whole = dtype is not None and np.dtype(dtype).kind in "iu"
    good = kind in "fiub" and not (whole and kind == "f" and array.size)
    wanted = "whole numbers" if whole else "numbers"
    if not good:
        raise PRTError(f"{name}: expected an array of {wanted}, got {shown(value)}")
    lengths = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
    fits = array.ndim == len(shape) and all(
        n is None or n == m for n, m in zip(shape, array.shape, strict=True)
    )
    expect(fits, f"{name}: expected an array of shape {lengths}, got {array.shape}")
    with np.errstate(over="ignore"):
        array = array if dtype is None else np.asarray(array, dtype)
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        n_bad = int(array.size - np.isfinite(array).sum())
        raise PRTError(f"{name}: {n_bad} values are NaN or infinite; expected finite numbers only")
    for bound, found in ((least, array.min), (most, array.max)):
        if bound is not None and array.size:
            good = found() >= bound if bound is least else found() <= bound
            bounds = _bounds(least, most, None, None)
            expect(good, f"{name}: expected values{bounds}, got {found():.4g}")
    return array


def _is_real(value):
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def _within(value, least, most, above, below):
    return (
        (least is None or value >= least)
        and (most is None or value <= most)
        and (above is None or value > above)
        and (below is None or value < below)
    )


def _bounds(least, most, above, below):
    if least is not None and most is not None:
        return f" from {_figure(least)} to {_figure(most)}"
    named = (">= ", least), ("above ", above), ("<= ", most), ("below ", below)
    parts = [f"{word}{_figure(bound)}" for word, bound in named if bound is not None]
    return f" {' and '.join(parts)}" if parts else ""


def _figure(bound):
    return f"{bound:.6g}" if isinstance(bound, float) else str(bound)
