"""Images of light: OpenEXR here, other formats through readers that `prt_core.blender` lends."""

from pathlib import Path

import numpy as np

from prt_core.errors import PRTError, expect, expect_array

_READERS = {}
_RGB, _GREY = ("R", "G", "B"), "Y"


def register_reader(suffix, reader):
    """Make a format known: `reader(path) -> (height, width, 3) float32`, first row on top."""
    _READERS[suffix] = reader


def read_image(path):
    """Read an image of linear light.

    Parameters
    ----------
    path : str or Path
        `.exr`: half, float or uint channels; RGB, RGBA or luminance only (Y); scan lines or
        tiles; of several parts or layers the first that has colour. `.hdr`: where Blender is
        there.

    Returns
    -------
    (height, width, 3) float32
        Linear, first row on top.

    Raises
    ------
    PRTError
        No such file, a format that is not read here, or no colour in it.
    """
    path = Path(path)
    expect(path.is_file(), f"{path}: there is no such image file")
    suffix = path.suffix.lower()
    if suffix in _READERS:
        return expect_array(str(path), _READERS[suffix](path), (None, None, 3), np.float32)
    if suffix == ".exr":
        return _read_exr(path)
    if suffix == ".hdr":
        raise PRTError(f"{path}: .hdr is read through Blender; pip install bpy, or convert to .exr")
    raise PRTError(f"{path}: expected an .exr or .hdr image, got '{suffix or 'no suffix'}'")


def reads_in_threads(path):
    """Whether `read_image` may be called beside the main thread: not where Blender reads."""
    suffix = Path(path).suffix.lower()
    return suffix == ".exr" and suffix not in _READERS


def write_image(path, pixels):
    """Write (height, width, 3) float32 pixels as an OpenEXR image, ZIP compressed."""
    import OpenEXR

    pixels = expect_array(str(path), pixels, (None, None, 3), np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels)}) as file:
        file.write(str(path))


def _read_exr(path):
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            for part in file.parts:
                found = _colour_channels(part.channels)
                if found:
                    return _to_array(path, part, found)
            names = [name for part in file.parts for name in part.channels]
    except PRTError:
        raise
    except Exception as error:
        raise PRTError(f"{path}: not a readable OpenEXR image ({error})") from error
    raise PRTError(f"{path}: no R, G, B or Y channels; it has {', '.join(names) or 'none'}")


def _colour_channels(channels):
    """Names of the three channels to read: the plain ones, else the first layer that has them."""
    layers = sorted({name.rpartition(".")[0] for name in channels})
    for layer in layers:
        prefix = layer + "." if layer else ""
        if all(prefix + c in channels for c in _RGB):
            return [prefix + c for c in _RGB]
    for layer in layers:
        prefix = layer + "." if layer else ""
        if prefix + _GREY in channels:
            return [prefix + _GREY] * 3
    return None


def _to_array(path, part, names):
    planes = [np.asarray(part.channels[name].pixels, np.float32) for name in names]
    expect(
        len({plane.shape for plane in planes}) == 1 and planes[0].ndim == 2,
        f"{path}: the colour channels differ in size (chroma sub-sampling); save them alike",
    )
    pixels = _on_display_window(part.header, np.stack(planes, axis=-1))
    if not np.isfinite(pixels).all():
        bad = int((~np.isfinite(pixels)).any(axis=-1).sum())
        raise PRTError(f"{path}: {bad} pixels are NaN or infinite; repair the image first")
    return pixels


def _on_display_window(header, pixels):
    """Pixels outside the stored data window are black, those outside the display are cut."""
    (dx0, dy0), _ = (np.asarray(corner) for corner in header["dataWindow"])
    low, high = (np.asarray(corner) for corner in header["displayWindow"])
    width, height = high - low + 1
    if (dx0, dy0) == tuple(low) and pixels.shape[:2] == (height, width):
        return pixels
    result = np.zeros((height, width, 3), np.float32)
    x, y = int(dx0 - low[0]), int(dy0 - low[1])
    source = pixels[max(0, -y) : height - y, max(0, -x) : width - x]
    result[max(0, y) :, max(0, x) :][: source.shape[0], : source.shape[1]] = source
    return result
