"""Uncompressed OpenEXR files of layers: what Blender wrote of a render, and what it is to read.

Read here rather than by a library: the program Blender may hold another OpenEXR than the Python
module brings, and two of them in one process can crash. Source: "OpenEXR file layout", openexr.com.
"""

import struct
from pathlib import Path

import numpy as np

from prt_core.errors import PRTError

_MAGIC, _LONG_NAMES, _MULTIPART = 20000630, 0x400, 0x1000
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


def write_channels(path, channels, texts):
    """Write channels as an uncompressed file of scanlines.

    Parameters
    ----------
    path : path-like
    channels : dict of str -> (height, width) float
        By their whole names, first row on top.
    texts : dict of str -> str
        Attributes of the header.
    """
    names = sorted(channels)
    rows = np.stack([np.asarray(channels[name], "<f4") for name in names], axis=1)
    height, _, width = rows.shape
    kind = struct.pack("<iB3xii", 2, 0, 1, 1)
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = [
        ("channels", "chlist", b"".join(n.encode() + b"\0" + kind for n in names) + b"\0"),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", box),
        ("displayWindow", "box2i", box),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
        *((name, "string", text.encode()) for name, text in texts.items()),
    ]
    header = struct.pack("<ii", _MAGIC, 2 | _LONG_NAMES)
    for name, of, value in attributes:
        header += name.encode() + b"\0" + of.encode() + b"\0"
        header += struct.pack("<i", len(value)) + value
    header += b"\0"
    size, first = 8 + rows[0].nbytes, len(header) + 8 * height
    table = np.arange(height, dtype="<u8") * size + first
    blocks = (struct.pack("<ii", y, row.nbytes) + row.tobytes() for y, row in enumerate(rows))
    Path(path).write_bytes(header + table.tobytes() + b"".join(blocks))
