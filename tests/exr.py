"""OpenEXR files byte by byte: kinds that OpenEXR's module does not write."""

import struct

import numpy as np

_TYPES = {0: np.uint32, 1: np.float16, 2: np.float32}


def exr_lines(channels, planes, width, height, more=b""):
    """An uncompressed file of scan lines.

    Parameters
    ----------
    channels : sequence of (name, type, columns, rows)
        Type 0 uint, 1 half, 2 float; every how many columns and rows there is a sample.
    planes : dict of str -> array
    width, height : int
    more : bytes
        Other attributes of the header.
    """
    channels = sorted(channels)
    start = _start(channels, width, height, more, 0)
    chunks = []
    for y in range(height):
        data = b"".join(
            planes[name][y // rows].astype(_TYPES[kind]).tobytes()
            for name, kind, _, rows in channels
            if y % rows == 0
        )
        chunks.append(struct.pack("<ii", y, len(data)) + data)
    return start + _chunks(len(start), chunks)


def exr_mip(planes, width, height, tile=4):
    """A file of float tiles at every level; only the first level holds the planes."""
    channels = [(name, 2, 1, 1) for name in sorted(planes)]
    tiles = attribute("tiles", "tiledesc", struct.pack("<IIB", tile, tile, 1))
    start = _start(channels, width, height, tiles, 0x200)
    chunks = []
    for level in range(max(width, height).bit_length()):
        wide, high = max(1, width >> level), max(1, height >> level)
        for row in range(0, high, tile):
            for column in range(0, wide, tile):
                data = b""
                for y in range(row, min(high, row + tile)):
                    for name in sorted(planes):
                        part = planes[name][y, column : min(wide, column + tile)]
                        data += (part if level == 0 else 0 * part - 9).astype("<f4").tobytes()
                head = struct.pack("<5i", column // tile, row // tile, level, level, len(data))
                chunks.append(head + data)
    return start + _chunks(len(start), chunks)


def attribute(name, kind, data):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data


def _start(channels, width, height, more, flags):
    named = b"".join(
        name.encode() + b"\0" + struct.pack("<i4xii", kind, columns, rows)
        for name, kind, columns, rows in channels
    )
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    return (
        struct.pack("<ii", 20000630, 2 | flags)
        + attribute("channels", "chlist", named + b"\0")
        + attribute("compression", "compression", b"\0")
        + attribute("dataWindow", "box2i", window)
        + attribute("displayWindow", "box2i", window)
        + attribute("lineOrder", "lineOrder", b"\0")
        + attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
        + attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0))
        + attribute("screenWindowWidth", "float", struct.pack("<f", 1))
        + more
        + b"\0"
    )


def _chunks(start, chunks):
    ends = start + 8 * len(chunks) + np.cumsum([0, *map(len, chunks)])
    return struct.pack(f"<{len(chunks)}Q", *ends[:-1]) + b"".join(chunks)
