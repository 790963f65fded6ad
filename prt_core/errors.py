"""What goes wrong, said in one line: the thing, what was expected, what came, what to do."""

import errno
import math
import numbers
import os
import re
from contextlib import contextmanager
from pathlib import Path

import numpy as np

_SHOWN = 60
# Bytes of a file's name, at most, on all systems.
_LONGEST = 255
# How an address in an object store begins, and no path does: a `Path` of one has a slash less.
_SCHEME = re.compile(r"[a-z][a-z0-9+.-]+:/", re.IGNORECASE)
# What numpy's integers hold.
_MOST_WHOLE = (1 << 63) - 1
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

    # Of a command that ends with it.
    exit_code = 2

    def __init__(self, message):
        # What the message quotes, a name or another program's words, may have several.
        super().__init__(" ".join(str(message).splitlines()))


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
    # To show a scene takes longer than some of the work it is handed to.
    if not isinstance(value, kinds):
        wanted = wanted or " or ".join(f"a {kind.__name__}" for kind in kinds)
        raise PRTError(f"{name}: expected {wanted}, got {shown(value)}")
    return value


def expect_offers(name, value, names, wanted):
    """`value`, where it has what an object of that kind has; for what is known by no class."""
    good = not isinstance(value, type) and all(hasattr(value, part) for part in names)
    expect(good, f"{name}: expected {wanted}, got {shown(value)}")
    return value


def expect_caster(caster):
    """`caster`, where it answers rays of one kind at least."""
    good = any(callable(getattr(caster, name, None)) for name in ("occluded", "intersect"))
    expect(good, f"caster: expected a RayCaster, got {shown(caster)}")
    return caster


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
    good = whole and _within(value, least, _MOST_WHOLE if most is None else most, None, None)
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
    expect(
        not _SCHEME.match(text),
        f"{name}: expected a path on this machine, got {shown(value)}; only bakes and light fields "
        "lie at addresses, which are given as text",
    )
    path = Path(text)
    longest = max(path.parts, key=len, default="")
    expect(
        len(os.fsencode(longest)) <= _LONGEST,
        f"{name}: a name of {len(longest)} letters is too long ({shown(longest)}); shorten it",
    )
    return path


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
    array = expect_numbers(name, value)
    whole = dtype is not None and np.dtype(dtype).kind in "iu"
    expect(
        not whole or array.dtype.kind != "f" or not array.size,
        f"{name}: expected an array of whole numbers, got {shown(value)}",
    )
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
    for bound, extreme in ((least, array.min), (most, array.max)):
        if bound is not None and array.size:
            good = extreme() >= bound if bound is least else extreme() <= bound
            bounds = _bounds(least, most, None, None)
            expect(good, f"{name}: expected values{bounds}, got {extreme():.4g}")
    return array


def expect_numbers(name, value):
    """`value` as an array of numbers of any shape; they may be NaN."""
    try:
        array = np.asarray(value)
        good = array.dtype.kind in "fiub"
    except (ValueError, TypeError):
        good = False
    expect(good, f"{name}: expected an array of numbers, got {shown(value)}")
    return array


def expect_indices(name, value, count):
    """One index, or (n,) of them, from 0 to `count` - 1, as an array; a slice stays one."""
    if isinstance(value, slice):
        return value
    array = expect_numbers(name, value)
    array = array[None] if array.ndim == 0 else array
    return expect_array(name, array, (None,), np.int64, 0, count - 1)


def expect_vectors(name, value):
    """(..., 3) float64: one vector, or any array of them."""
    array = expect_numbers(name, value)
    return expect_array(name, array, (*(None,) * max(array.ndim - 1, 0), 3), np.float64)


def expect_mask(name, value, count):
    """(count,) bool."""
    array = expect_numbers(name, value)
    good = array.dtype.kind == "b" and array.shape == (count,)
    expect(good, f"{name}: expected {count} values True or False, got {shown(value)}")
    return array


def expect_all(name, values, kinds, wanted):
    """A list, tuple or other sequence all of whose members are of some class, as a list."""
    good = isinstance(values, list | tuple) and all(isinstance(v, kinds) for v in values)
    expect(good, f"{name}: expected a list of {wanted}, got {shown(values)}")
    return list(values)


def expect_named(name, values, kinds, wanted):
    """A dict from text to members of some class, as it is."""
    good = isinstance(values, dict) and all(
        isinstance(key, str) and isinstance(value, kinds) for key, value in values.items()
    )
    expect(good, f"{name}: expected a dict of {wanted} by name, got {shown(values)}")
    return values


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
