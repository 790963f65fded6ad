"""Linear pictures as a display shows them, of 8 or 16 bits, and these as PNG files."""

import struct
import zlib

import numpy as np

from prt_core.errors import (
    expect,
    expect_array,
    expect_kind,
    expect_number,
    expect_numbers,
    expect_one_of,
    expect_path,
    shown,
)
from prt_core.runtime.files import written
from prt_core.scene import ViewTransform

# Types of the pixels, by bits of a channel.
_TYPES = {8: np.uint8, 16: np.uint16}


def to_display(linear, view_transform=None, exposure=0.0, bits=8):
    """A linear picture as a scene shows it: what a render of the file looks like.

    Parameters
    ----------
    linear : (height, width, 3) float
    view_transform : ViewTransform, optional
        Of the scene, as `Bake.view_transform` has it; default: none, see `to_srgb`.
    exposure : float
        Stops beside the scene's own.
    bits : {8, 16}
        Of a channel.

    Returns
    -------
    (height, width, 3) uint8 or uint16
        sRGB.
    """
    if view_transform is None:
        return to_srgb(linear, exposure, bits)
    expect_kind("view_transform", view_transform, ViewTransform)
    linear = expect_array("picture", linear, (None, None, 3))
    shown = view_transform.display(linear.reshape(-1, 3), exposure)
    return to_whole(shown.reshape(linear.shape), bits)


def to_srgb(linear, exposure=0.0, bits=8):
    """Linear radiance as sRGB bytes; brighter than white is cut.

    Parameters
    ----------
    linear : (..., 3) float
    exposure : float
        Stops.
    bits : {8, 16}
        Of a channel.

    Returns
    -------
    (..., 3) uint8 or uint16
    """
    stops = expect_number("exposure", exposure, -64, 64)
    linear = expect_numbers("linear", linear)
    expect(not np.isnan(linear).any(), "linear: expected no NaN")
    with np.errstate(over="ignore"):
        value = np.clip(np.asarray(linear, np.float32) * np.float32(2.0**stops), 0, 1)
    curve = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    return to_whole(curve, bits)


def to_whole(values, bits=8):
    """Shares from 0 to 1 as whole numbers, without a curve; what lies beyond is cut.

    Parameters
    ----------
    values : (..., n) float
    bits : {8, 16}
        Of a channel.

    Returns
    -------
    (..., n) uint8 or uint16
    """
    values = expect_numbers("values", values)
    expect(not np.isnan(values).any(), "values: expected no NaN")
    good = isinstance(bits, int) and bits in _TYPES
    expect(good, f"bits: expected 8 or 16, got {shown(bits)}")
    kind = _TYPES[bits]
    most = np.iinfo(kind).max
    return (np.clip(values, 0, 1) * most + 0.5).astype(kind)


def write_png(path, image, curve="srgb"):
    """Write a picture, whole or not at all.

    Parameters
    ----------
    path : str or Path
    image : (height, width, 3) uint8 or uint16
    curve : {"srgb", "data"}
        What its values are: sRGB, or numbers that are no colours.
    """
    path = expect_path("picture", path)
    expect(path.suffix.lower() == ".png", f"{path}: expected a name that ends in .png")
    data = png_bytes(image, curve)
    with written(path) as part:
        part.write_bytes(data)


def png_bytes(image, curve="srgb"):
    """Pixels as a PNG file (ISO/IEC 15948); the parameters are those of `write_png`."""
    expect_one_of("curve", curve, ("srgb", "data"))
    image = expect_array("picture", image, (None, None, 3))
    expect(
        image.dtype in _TYPES.values() and image.size,
        f"picture: expected some pixels of uint8 or uint16, got {shown(image)}",
    )
    height, width, _ = image.shape
    depth = image.dtype.itemsize
    # The larger byte first.
    flat = np.ascontiguousarray(image.astype(image.dtype.newbyteorder(">")))
    flat = flat.view(np.uint8).reshape(height, -1)
    # Filter 2: each row less the one above it.
    rows = np.full((height, 1 + 3 * depth * width), 2, np.uint8)
    rows[:, 1:] = flat
    rows[1:, 1:] -= flat[:-1]
    header = struct.pack(">IIBBBBB", width, height, 8 * depth, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    if curve == "srgb":
        chunks.insert(1, (b"sRGB", b"\0"))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
