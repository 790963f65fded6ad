"""Blender images as linear float arrays."""

from importlib.util import find_spec

import bpy
import numpy as np

from prt_core.errors import PRTError, expect
from prt_core.light.images import register_reader

_LINEAR = ("Linear Rec.709", "Linear", "Non-Color", "Linear BT.709", "scene_linear", "Raw")


def has_known_colours(image):
    """Whether `pixels_of` can tell the colours of an image that has pixels."""
    known = image.is_float or image.colorspace_settings.name in {"sRGB", *_LINEAR}
    return known and image.type != "MULTILAYER"


def pixels_of(image):
    """(height, width, 4) float32 of a Blender image, linear Rec.709, first row on top.

    Raises
    ------
    PRTError
        The file is missing, or the colour space of an image of bytes is neither sRGB nor linear
        Rec.709.
    """
    width, height = image.size
    # Known once its size was asked for.
    expect(
        image.type != "MULTILAYER",
        f"image '{image.name}': has several layers, whose pixels Blender keeps to itself; save the "
        "Combined one alone",
    )
    expect(
        width > 0 and height > 0,
        f"image '{image.name}': no pixels; its file '{image.filepath}' is missing or unreadable",
    )
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, image.channels)[::-1]
    if image.channels < 3:
        values = np.concatenate([values[..., :1]] * 3 + [np.ones_like(values[..., :1])], axis=-1)
    elif image.channels == 3:
        values = np.concatenate([values, np.ones_like(values[..., :1])], axis=-1)
    space = image.colorspace_settings.name
    if image.is_float:
        # Blender has made these linear Rec.709 whatever their file holds.
        pass
    elif space == "sRGB":
        values = np.concatenate([linear_of_srgb(values[..., :3]), values[..., 3:]], axis=-1)
    elif space not in _LINEAR:
        raise PRTError(
            f"image '{image.name}': colour space '{space}' is not understood; "
            "use sRGB, Linear Rec.709 or Non-Color"
        )
    return np.ascontiguousarray(values)


def linear_of_srgb(values):
    """Linear values of sRGB ones (IEC 61966-2-1)."""
    low = values / np.float32(12.92)
    high = ((np.maximum(values, 0) + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(values <= 0.04045, low, high)


def _read(path):
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.name = "Linear Rec.709"
        return pixels_of(image)[..., :3]
    finally:
        bpy.data.images.remove(image)


def register():
    """Lend Blender's reader of .exr inside the program Blender.

    The program may hold another OpenEXR library than the Python module brings, and two of them
    in one process can crash (Debian's Blender does).
    """
    if bpy.app.binary_path or find_spec("OpenEXR") is None:
        register_reader(".exr", _read)
