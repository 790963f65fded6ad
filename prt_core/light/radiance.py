"""Radiance pictures (.hdr): run-length coded RGB with a shared exponent (Ward 1991).

Read here and not by Blender, whose versions differ in what they make of rows stored upwards; and
so that images need no Blender.
"""

import re

import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.light.primaries import to_rec709
from prt_core.runtime.machine import expect_memory

# Bytes of a header at most; widths that are coded component by component.
_HEADER, _WIDE = 1 << 16, range(8, 32768)
_AGAIN = "; it was cut off or is damaged, copy or download it again"
_SIZE = re.compile(rb"([-+])Y +(\d+) +([-+])X +(\d+)")


def read_radiance(path):
    """Pixels of a Radiance picture, and what is to be said about them.

    Parameters
    ----------
    path : Path

    Returns
    -------
    pixels : (height, width, 3) float32
        Linear Rec.709, as they are stored: an exposure or correction that the header tells of is
        in them already, and stays, as in Blender.
    notes : list of str

    Raises
    ------
    PRTError
        It is something else, holds XYZ, lies on its side, or was cut off.
    """
    data = np.fromfile(path, np.uint8)
    head = data[:_HEADER].tobytes()
    expect(head.startswith(b"#?"), f"{path}: not a readable Radiance image; convert it to .exr")
    end = head.find(b"\n\n")
    last = head.find(b"\n", end + 2)
    expect(end > 0 and last > 0, f"{path}: not a readable Radiance image{_AGAIN}")
    lines = head[:end].decode("ascii", "replace").splitlines()[1:]
    # Lines may come several times: exposures are multiplied.
    parts = (line.partition("=") for line in lines if "=" in line and line[:1] != "#")
    fields = [(name.strip().upper(), value.strip()) for name, _, value in parts]
    named = dict(fields)
    form = named.get("FORMAT", "32-bit_rle_rgbe")
    expect(
        form == "32-bit_rle_rgbe",
        f"{path}: its format '{form}' is not understood; convert it with 'ra_xyze -r' to RGB",
    )
    dimensions = _SIZE.fullmatch(head[end + 2 : last].strip())
    if not dimensions:
        raise PRTError(
            f"{path}: its orientation '{head[end + 2 : last].decode('ascii', 'replace')[:40]}' is "
            "not understood; turn it to '-Y height +X width' with 'pflip' or 'protate'"
        )
    height, width = int(dimensions[2]), int(dimensions[4])
    expect(height > 0 and width > 0, f"{path}: the image has no pixels")
    expect_memory(str(path), 40.0 * height * width, "scale it down")
    coded = _decoded(path, data[last + 1 :], height, width)
    scale = np.ldexp(np.float32(1), coded[..., 3].astype(np.int32) - 136)
    scale[coded[..., 3] == 0] = 0
    pixels = coded[..., :3] * scale[..., None].astype(np.float32)
    if dimensions[1] == b"+":
        pixels = pixels[::-1]
    if dimensions[3] == b"-":
        pixels = pixels[:, ::-1]
    notes = [
        f"{path}: its {name} {value} is not applied, as in Blender"
        for name, value in fields
        if name in ("EXPOSURE", "COLORCORR") and set(_numbers(value)) != {1.0}
    ]
    places = _numbers(named.get("PRIMARIES", ""))
    matrix = to_rec709(str(path), places) if len(places) == 8 else None
    if matrix is not None:
        pixels = pixels @ matrix.T.astype(np.float32)
        notes.append(f"{path}: converted from the primaries of its header to Rec.709")
    return np.ascontiguousarray(pixels), notes


def _numbers(text):
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []


def _decoded(path, data, height, width):
    """(height, width, 4) uint8 of red, green, blue and exponent."""
    mark = bytes([2, 2, width >> 8 & 255, width & 255])
    if width not in _WIDE or data[:4].tobytes() != mark:
        return _flat(path, data, height, width)
    stored, at, filled = data.tobytes(), 0, 0
    # Row by row, and in a row component by component.
    out = bytearray(4 * width * height)
    for _ in range(height):
        expect(stored[at : at + 4] == mark, f"{path}: a row is missing{_AGAIN}")
        at += 4
        for _ in range(4):
            stop = filled + width
            while filled < stop:
                count = stored[at] if at < len(stored) else 0
                if count > 128:
                    # One byte, so many times.
                    count -= 128
                    values, at = stored[at + 1 : at + 2] * count, at + 2
                else:
                    values, at = stored[at + 1 : at + 1 + count], at + 1 + count
                good = count and len(values) == count <= stop - filled
                expect(good, f"{path}: its pixels end too early{_AGAIN}")
                out[filled : filled + count] = values
                filled += count
    coded = np.frombuffer(out, np.uint8).reshape(height, 4, width)
    return coded.transpose(0, 2, 1)


def _flat(path, data, height, width):
    """Pixels as they are, or with the older runs: 1, 1, 1, n repeats the pixel before n times."""
    data = data[: len(data) // 4 * 4].reshape(-1, 4)
    runs = (data[:, :3] == 1).all(axis=1)
    if not runs.any():
        expect(len(data) >= height * width, f"{path}: its pixels end too early{_AGAIN}")
        return data[: height * width].reshape(height, width, 4)
    # The digits of a count, the lowest first, are runs one after another.
    counts, place = np.ones(len(data), np.int64), 0
    for index in np.flatnonzero(runs):
        place = place + 8 if index and runs[index - 1] else 0
        counts[index] = int(data[index, 3]) << min(place, 32)
    source = np.where(runs, -1, np.arange(len(data)))
    source = np.maximum.accumulate(source)
    expect(source[0] >= 0, f"{path}: it begins with a repetition{_AGAIN}")
    ends = np.cumsum(counts)
    expect(ends[-1] >= height * width, f"{path}: its pixels end too early{_AGAIN}")
    index = np.searchsorted(ends, np.arange(height * width), "right")
    return data[source[index]].reshape(height, width, 4)
