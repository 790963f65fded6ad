"""Images of light: OpenEXR and Radiance here, or through readers that `prt_core.blender` lends."""

import io
import os
from contextlib import ExitStack, contextmanager, redirect_stdout

import numpy as np

from prt_core.errors import PRTError, expect, expect_array, expect_path, system_errors
from prt_core.light.exr_header import read_parts
from prt_core.light.primaries import to_rec709
from prt_core.light.radiance import read_radiance
from prt_core.runtime.files import written
from prt_core.runtime.machine import expect_memory

_READERS = {}
_RGB, _GREY = ("R", "G", "B"), "Y"
# Beside which Y is no grey image.
_NO_GREY = {
    "luminance and chroma (Y, RY, BY)": ("RY", "BY"),
    "vectors or CIE colours (X, Y, Z)": ("X", "Z"),
}
# What the main layer of a file is called; others are passes, such as AO.
_MAIN = ("", "combined", "composite", "rgba", "rgb", "beauty", "color", "colour", "main", "default")
_MOST_NAMES = 6


def register_reader(suffix, reader):
    """Make a format known: `reader(path) -> (height, width, 3) float32`, first row on top.

    Where one is known for ".exr", the header is still read here (see `read_picture`).
    """
    _READERS[suffix] = reader


def read_image(path):
    """Read an image of linear light; see `read_picture`.

    Returns
    -------
    (height, width, 3) float32
        Linear Rec.709, first row on top.
    """
    return read_picture(path)[0]


def read_picture(path):
    """Read an image of linear light, and what is to be said about it.

    Parameters
    ----------
    path : str or Path
        `.exr`: half, float or uint channels; RGB, RGBA or luminance only (Y); scan lines or
        tiles; of several parts or layers the main one (see `main_layer`). `.hdr`: see
        `read_radiance`. Other primaries than Rec.709's are converted.

    Returns
    -------
    pixels : (height, width, 3) float32
        Linear Rec.709, first row on top.
    notes : list of str
        Which layer was read where there were several, and what was converted.

    Raises
    ------
    PRTError
        No such file, a format that is not read here, no colour in it, or values that are not
        finite.
    """
    path = expect_path("image", path)
    with system_errors(path):
        return _read(path)


def _read(path):
    expect(path.is_file(), f"{path}: there is no such image file")
    suffix = path.suffix.lower()
    if suffix == ".exr":
        pixels, notes = _read_exr(path)
    elif suffix in _READERS:
        pixels, notes = np.asarray(_READERS[suffix](path), np.float32), []
    elif suffix == ".hdr":
        pixels, notes = read_radiance(path)
    else:
        raise PRTError(f"{path}: expected an .exr or .hdr image, got '{suffix or 'no suffix'}'")
    bad = ~np.isfinite(pixels).all(axis=-1)
    expect(
        not bad.any(),
        f"{path}: {told(bad, 'NaN or infinite')}; repair the image first: paint over them, or "
        f"'oiiotool {path.name} --fixnan box3 -o repaired.exr'",
    )
    return expect_array(str(path), pixels, (None, None, 3), np.float32), notes


def told(bad, what):
    """How many pixels of a (height, width) mask are wrong, and where the first of them is."""
    row, column = np.argwhere(bad)[0] if bad.any() else (0, 0)
    return (
        f"{int(bad.sum()):,} pixels are {what}, the first at column {column}, row {row}, counted "
        "from 0 at the top left"
    )


def reads_in_threads(path):
    """Whether `read_image` may be called beside the main thread: not where Blender reads."""
    suffix = expect_path("image", path).suffix.lower()
    return suffix in (".exr", ".hdr") and suffix not in _READERS


def write_image(path, pixels):
    """Write (height, width, 3) float32 pixels to a path, as OpenEXR; whole or not at all."""
    import OpenEXR

    path = expect_path("image", path)
    expect(path.suffix.lower() == ".exr", f"{path}: expected a name that ends in .exr")
    pixels = expect_array(str(path), pixels, (None, None, 3), np.float32)
    expect(pixels.size, f"{path}: the image has no pixels")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with written(path) as part, OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels)}) as file:
        try:
            file.write(str(part))
        except RuntimeError as error:
            raise OSError(None, " ".join(str(error).split())) from error


def main_layer(path, parts):
    """The layer that is the image: plain R, G, B; else the one called Combined or the like.

    Parameters
    ----------
    path : Path
        For messages.
    parts : list of Part

    Returns
    -------
    index : int
        Of the part.
    names : list of str
        Of the three channels.
    label : str
        Of the part and layer; empty for plain channels.
    others : list of str
        Labels that were not chosen.

    Raises
    ------
    PRTError
        No colour, or several layers of which none is called as the main one would be.
    """
    for wanted in (_RGB, (_GREY,) * 3):
        layers = [
            (index, [prefix + name for name in wanted], _label(part, len(parts) > 1, prefix))
            for index, part in enumerate(parts)
            for prefix in dict.fromkeys(_prefix(name) for name in part.channels)
            if all(prefix + name in part.channels for name in wanted)
        ]
        if layers:
            break
    names = [name for part in parts for name in part.channels]
    expect(layers, f"{path}: no R, G, B or Y channels; it has {', '.join(names) or 'none'}")
    main = [item for item in layers if item[2].rpartition(".")[2].lower() in _MAIN]
    # Plain channels go before any layer.
    main.sort(key=lambda item: item[2] != "")
    labels = [label or "R, G, B" for *_, label in layers]
    expect(
        main or len(layers) == 1,
        f"{path}: has the layers {_listed(labels)}, and none is called Combined or main; save the "
        "one that is meant alone",
    )
    index, channels, label = (main or layers)[0]
    return index, channels, label, [other for other in labels if other != (label or "R, G, B")]


def _prefix(name):
    layer, dot, _ = name.rpartition(".")
    return layer + dot


def _label(part, several, prefix):
    label = ".".join(filter(None, (part.name if several else "", prefix.rstrip("."))))
    # The two views of a stereo image are the same layer; the first is read.
    if part.view and (label == part.view or label.endswith(f".{part.view}")):
        label = label[: -len(part.view)].rstrip(".")
    return label


def _listed(labels):
    first_names = ", ".join(labels[:_MOST_NAMES])
    return first_names + (
        f" and {len(labels) - _MOST_NAMES} more" if len(labels) > _MOST_NAMES else ""
    )


def _read_exr(path):
    parts = read_parts(path)
    index, names, label, others = main_layer(path, parts)
    part = parts[index]
    expect(
        not part.deep, f"{path}: deep images are not understood; flatten it to one layer of pixels"
    )
    prefix = _prefix(names[0])
    for what, more in _NO_GREY.items():
        expect(
            names[0] != names[1] or not any(prefix + name in part.channels for name in more),
            f"{path}: {what} are not understood; save it as R, G, B",
        )
    sampled = {part.channels[name][1:] for name in names}
    expect(
        sampled == {(1, 1)},
        f"{path}: its colours are stored for some of the pixels only (sub-sampling); "
        "save them for all",
    )
    needed = 4 * sum(other.nbytes for other in parts) + 16 * _size(part.display)
    expect_memory(str(path), needed, "scale it down")
    notes = []
    if others:
        notes.append(f"{path}: read is {label or 'plain R, G, B'}, not {_listed(others)}")
    reader = _READERS.get(".exr")
    if reader is None:
        pixels = _decoded(path, part, index, names)
    else:
        expect(
            len(parts) == 1 and not label,
            f"{path}: Blender reads no layers here; save {label or 'the plain R, G, B'} alone",
        )
        pixels = np.asarray(reader(path), np.float32)
    matrix = to_rec709(str(path), part.chromaticities) if part.chromaticities else None
    if matrix is not None and names[0] != names[1]:
        given = pixels
        pixels = pixels @ matrix.T.astype(np.float32)
        notes.append(f"{path}: converted from the primaries of its header to Rec.709")
        # Colours outside Rec.709 have a negative channel that the image had not.
        pixels = np.where((given >= 0).all(axis=-1, keepdims=True), np.maximum(pixels, 0), pixels)
    return pixels, notes


def _size(window):
    return (window[2] - window[0] + 1) * (window[3] - window[1] + 1)


def _decoded(path, part, index, names):
    import OpenEXR

    try:
        with _silence(), OpenEXR.File(str(path), separate_channels=True) as file:
            expect(
                len(file.parts) > index,
                f"{path}: not a readable OpenEXR image, its pixels cannot be decoded; "
                "copy or download it again",
            )
            channels = file.parts[index].channels
            planes = [np.asarray(channels[name].pixels, np.float32) for name in names]
    except PRTError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())
        raise PRTError(f"{path}: not a readable OpenEXR image ({reason})") from error
    return _on_display_window(part, np.stack(planes, axis=-1))


@contextmanager
def _silence():
    """OpenEXR prints what it cannot decode, by Python and by C; the error that follows says it."""
    with ExitStack() as stack:
        stack.enter_context(redirect_stdout(io.StringIO()))
        try:
            kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
        except OSError:
            # A program without a console shows nothing as it is.
            yield
            return
        stack.callback(os.close, kept)
        stack.callback(os.dup2, kept, 2)
        os.dup2(nowhere, 2)
        os.close(nowhere)
        yield


def _on_display_window(part, pixels):
    """Pixels outside the stored data window are black, those outside the display are cut."""
    dx, dy = part.window[:2]
    left, top, right, bottom = part.display
    width, height = right - left + 1, bottom - top + 1
    if (dx, dy) == (left, top) and pixels.shape[:2] == (height, width):
        return pixels
    result = np.zeros((height, width, 3), np.float32)
    x, y = dx - left, dy - top
    source = pixels[max(0, -y) : max(height - y, 0), max(0, -x) : max(width - x, 0)]
    result[max(0, y) :, max(0, x) :][: source.shape[0], : source.shape[1]] = source
    return result
