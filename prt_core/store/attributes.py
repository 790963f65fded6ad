"""The attributes of a bake: those of its Zarr group, read with strict limits, and sealed.

The seal is a digest of all other attributes. It is no signature: it tells damage and edits by hand
from what this library wrote, and no change of them goes unnoticed.
"""

import hashlib
import json
import math
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from prt_core.errors import PRTError, expect

FORMAT, VERSION = "prt bake", 3
FILE = "zarr.json"
# Thousands of objects take a few megabytes; an empty list takes thirty times its letters in memory.
_MOST_BYTES = 16 << 20
_MOST_DEPTH = 24
_AGAIN = "bake again with --restart"


def read_attributes(files):
    """The attributes in a folder, None where there are none yet.

    Parameters
    ----------
    files : Files

    Raises
    ------
    PRTError
        They are not of a bake, of another version, damaged or edited.
    """
    text = files.read(FILE, _MOST_BYTES)
    if text is None:
        return None
    path = files.root
    group = parse(text, f"{path}: is not a bake of this library or is damaged ({FILE}")
    attributes = group.get("attributes")
    expect(
        group.get("node_type") == "group"
        and isinstance(attributes, dict)
        and attributes.get("format") == FORMAT,
        f"{path}: is not a bake of this library; expected a folder made by 'prt bake'",
    )
    version = attributes.get("version")
    expect(
        type(version) is int and version <= VERSION,
        f"{path}: has store version {version!r:.20}, this library reads {VERSION}; update it",
    )
    expect(version == VERSION, f"{path}: was baked by an older version of this library; {_AGAIN}")
    expect(
        group == _group(attributes) and attributes.get("seal") == _seal(attributes),
        f"{path}: what is said of the bake in {FILE} was damaged or edited; {_AGAIN}",
    )
    return attributes


def is_foreign(files):
    """Whether a folder holds a group or array that no version of this library wrote."""
    try:
        group = parse(files.read(FILE, _MOST_BYTES) or b"", "")
    except PRTError:
        return False
    attributes = group.get("attributes")
    return not (isinstance(attributes, dict) and attributes.get("format") == FORMAT)


def write_attributes(files, attributes, now=None):
    """Replace the attributes in a folder by one file that is on the disk when this returns.

    Parameters
    ----------
    files : Files
    attributes : dict
    now : dict, optional
        Those that are there: where they are the same nothing is written.

    Returns
    -------
    dict
        They as they are read.

    Raises
    ------
    PRTError
        They hold NaN, infinity, or more than is ever read again.
    """
    try:
        text = json.dumps(attributes, default=_plain)
    except (TypeError, ValueError) as error:
        raise PRTError(f"{files.root}: cannot keep what is said of the bake ({error})") from error
    attributes = parse(text.encode(), f"{files.root}: cannot keep what is said of the bake (it")
    attributes["seal"] = _seal(attributes)
    if attributes == now:
        return attributes
    text = json.dumps(_group(attributes)).encode()
    expect(
        len(text) <= _MOST_BYTES,
        f"{files.root}: what is said of the bake takes {len(text):,} bytes, {_MOST_BYTES:,} at "
        "most are kept; bake fewer objects at once",
    )
    files.write(FILE, text, lasting=True)
    return attributes


@contextmanager
def damage_as_error(path, what="its description", again=_AGAIN):
    """Turns what goes wrong with attributes of another shape than expected into one line.

    Parameters
    ----------
    path : str or Path
        Of the bake.
    what : str
        What is damaged.
    again : str
        What to do about it.
    """
    try:
        yield
    except PRTError as error:
        text = " ".join(str(error).split())
        if str(path) not in text:
            text = f"{path}: {text}" + ("" if again in text else f"; {what} is damaged, {again}")
        raise PRTError(text) from error
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        reason = " ".join(repr(error).split())[:120]
        raise PRTError(f"{path}: {what} is damaged ({reason}); {again}") from error


def parse(text, begin):
    """A JSON object of bytes, without what this library never writes.

    Parameters
    ----------
    text : bytes
    begin : str
        Of the message of the error.

    Raises
    ------
    PRTError
        No JSON object; names that come twice; NaN, infinity, whole numbers of more than 64 bits;
        lists in lists in lists; letters that are none.
    """
    try:
        value = json.loads(
            text.decode(),
            object_pairs_hook=_once,
            parse_constant=_refused,
            parse_int=_whole,
            parse_float=_finite,
        )
        _expect_flat(value)
    except (ValueError, RecursionError) as error:
        reason = " ".join((str(error) or type(error).__name__).split())[:80]
        raise PRTError(f"{begin} cannot be read: {reason})") from None
    return value


def digest(*parts):
    """Hexadecimal digest of 128 bits of bytes."""
    state = hashlib.blake2b(digest_size=16)
    for part in parts:
        state.update(part)
    return state.hexdigest()


def _group(attributes):
    return {"zarr_format": 3, "node_type": "group", "attributes": attributes}


def _seal(attributes):
    rest = {key: value for key, value in attributes.items() if key != "seal"}
    return digest(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode())


def _plain(value):
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value)} cannot be stored")


def _once(pairs):
    values = dict(pairs)
    if len(values) < len(pairs):
        raise ValueError("a name comes twice")
    return values


def _refused(word):
    raise ValueError(f"{word} is no number")


def _whole(digits):
    value = int(digits) if len(digits) <= 20 else 1 << 64
    if not -(1 << 63) <= value < 1 << 63:
        raise ValueError("a number is too large")
    return value


def _finite(digits):
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError("a number is too large")
    return value


def _expect_flat(value):
    if not isinstance(value, dict):
        raise ValueError("it is no object")
    level = [value]
    for _ in range(_MOST_DEPTH):
        inside = []
        for item in level:
            if isinstance(item, dict):
                inside += [*item.keys(), *item.values()]
            elif isinstance(item, list):
                inside += item
            elif isinstance(item, str):
                item.encode()
        level = inside
        if not level:
            return
    raise ValueError("lists are nested too deeply")
