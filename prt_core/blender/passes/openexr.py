"""The layers of an uncompressed OpenEXR file, as Blender writes what it rendered.

Read here rather than by a library: the program Blender may hold another OpenEXR than the Python
module brings, and two of them in one process can crash. Source: "OpenEXR file layout", openexr.com.
"""

import struct
from pathlib import Path

import numpy as np

from prt_core.errors import PRTError

_MAGIC, _MULTIPART = 20000630, 0x1000
_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}


def read_channels(path):
    """Every channel of a file.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    dict of str -> (height, width) array
        By the channel's whole name, first row on top.

    Raises
    ------
    PRTError
        It is no such file, or its pixels are compressed.
    """
    data = Path(path).read_bytes()
    magic, version = struct.unpack_from("<ii", data)
    if magic != _MAGIC or version & 0xFF != 2:
        raise PRTError(f"{path}: expected an OpenEXR file of version 2")
    place, headers = 8, []
    while True:
        header, place = _header(data, place)
        if not header:
            break
        headers.append(header)
        if not version & _MULTIPART:
            break
    tables = []
    for header in headers:
        if header["compression"] != b"\0":
            raise PRTError(f"{path}: expected uncompressed pixels")
        left, top, right, bottom = struct.unpack("<4i", header["dataWindow"])
        height, width = bottom - top + 1, right - left + 1
        tables.append((height, width, np.frombuffer(data, "<u8", height, place)))
        place += 8 * height
    channels = {}
    # A block is one row: its number, its size, and the row of each channel in turn.
    prefix = 12 if version & _MULTIPART else 8
    for header, (height, width, offsets) in zip(headers, tables, strict=True):
        names, dtype = _channel_types(header["channels"], width)
        rows = np.stack(
            [np.frombuffer(data, np.uint8, dtype.itemsize, int(o) + prefix) for o in offsets]
        )
        block = rows.view(dtype).reshape(height)
        channels |= {name: block[name] for name in names}
    return channels


def _header(data, place):
    """Name -> bytes of the attributes of one part, and where they end; empty at the last one."""
    attributes = {}
    while data[place]:
        name, place = _text(data, place)
        _, place = _text(data, place)
        (size,) = struct.unpack_from("<i", data, place)
        attributes[name] = data[place + 4 : place + 4 + size]
        place += 4 + size
    return attributes, place + 1


def _text(data, place):
    end = data.index(b"\0", place)
    return data[place:end].decode("utf-8", "replace"), end + 1


def _channel_types(data, width):
    """Names of the channels of a part, and the dtype of one of its rows."""
    place, fields = 0, []
    while data[place]:
        name, place = _text(data, place)
        (kind,) = struct.unpack_from("<i", data, place)
        fields.append((name, _TYPES[kind], (width,)))
        place += 16
    return [name for name, _, _ in fields], np.dtype(fields)
