"""Linear pictures as sRGB bytes, and these as PNG files."""

import struct
import zlib

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_number,
    expect_numbers,
    expect_path,
    shown,
)
from prt_core.runtime.files import written


def to_srgb(linear, exposure=0.0):
    """Linear radiance as sRGB bytes; brighter than white is cut.

    Parameters
    ----------
    linear : (..., 3) float
    exposure : float
        Stops.

    Returns
    -------
    (..., 3) uint8
    """
    stops = expect_number("exposure", exposure, -64, 64)
    linear = expect_numbers("linear", linear)
    expect(not np.isnan(linear).any(), "linear: expected no NaN")
    with np.errstate(over="ignore"):
        value = np.clip(np.asarray(linear, np.float32) * np.float32(2.0**stops), 0, 1)
    curve = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    return (curve * 255 + 0.5).astype(np.uint8)


def write_png(path, image):
    """Write an `image` of (height, width, 3) uint8 sRGB pixels to a `path`, whole or not at all."""
    path = expect_path("picture", path)
    expect(path.suffix.lower() == ".png", f"{path}: expected a name that ends in .png")
    data = png_bytes(image)
    with written(path) as part:
        part.write_bytes(data)


def png_bytes(image):
    """(height, width, 3) uint8 sRGB pixels as a PNG file (ISO/IEC 15948)."""
    image = expect_array("picture", image, (None, None, 3))
    expect(
        image.dtype == np.uint8 and image.size,
        f"picture: expected some pixels of uint8, got {shown(image)}",
    )
    height, width, _ = image.shape
    flat = image.reshape(height, -1)
    # Filter 2: each row less the one above it.
    rows = np.full((height, 1 + 3 * width), 2, np.uint8)
    rows[:, 1:] = flat
    rows[1:, 1:] -= flat[:-1]
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = (b"IHDR", header), (b"sRGB", b"\0"), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
