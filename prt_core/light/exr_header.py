"""The header of an OpenEXR file: its parts and layers, and what readers pass over in silence.

Read here, byte by byte ("OpenEXR File Layout", Kainz, Bogart & Hess), for Blender's reader and
OpenEXR's own need the same answers before a pixel is decoded.
"""

import struct
from dataclasses import dataclass, field

from prt_core.errors import PRTError, expect

_MAGIC = b"\x76\x2f\x31\x01"
_DEEP, _SEVERAL = 0x800, 0x1000
# Bytes in which all headers and tables are looked for.
_MOST = 1 << 24
# Lines of a chunk, by the number of the compression.
_LINES = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}
_BYTES = {0: 4, 1: 2, 2: 4}
_SIGNATURES = {
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"#?": "a Radiance image (.hdr)",
    b"II*\0": "a TIFF image",
    b"MM\0*": "a TIFF image",
    b"RIFF": "a WebP image",
    b"PK": "a zip archive",
    b"<": "a web page; the download has failed",
}


@dataclass(frozen=True)
class Part:
    """One part of a file.

    Attributes
    ----------
    name, kind, view : str
        `kind`: "scanlineimage", "tiledimage", "deepscanline" or "deeptile"; `view` of a stereo
        image, or empty.
    channels : dict of str -> (int, int, int)
        Type (0 uint, 1 half, 2 float), and every how many columns and rows there is a sample.
    window, display : (int, int, int, int)
        First column and row, last column and row: of what is stored, and of the image.
    chromaticities : (8,) tuple of float, or None
    chunks : int or None
        As the header says, where it does.
    """

    name: str
    kind: str
    view: str
    channels: dict
    window: tuple
    display: tuple
    chromaticities: tuple | None = None
    chunks: int | None = field(default=None, repr=False)

    @property
    def deep(self):
        """Whether pixels hold several samples each."""
        return self.kind.startswith("deep")

    @property
    def nbytes(self):
        """Bytes of its pixels in memory."""
        x0, y0, x1, y1 = self.window
        size = sum(_BYTES.get(kind, 4) / (x * y) for kind, x, y in self.channels.values())
        return (x1 - x0 + 1) * (y1 - y0 + 1) * size


def read_parts(path):
    """The parts of an OpenEXR file, in their order.

    Parameters
    ----------
    path : Path

    Returns
    -------
    list of Part

    Raises
    ------
    PRTError
        It is something else, has no pixels, is damaged, or was cut off.
    """
    with path.open("rb") as file:
        data = file.read(_MOST)
        parts, whole = _parts_in(path, data, file)
    for part in parts:
        x0, y0, x1, y1 = part.display
        expect(
            x1 >= x0 and y1 >= y0 and part.window[2] >= part.window[0]
            and part.window[3] >= part.window[1],
            f"{path}: the image has no pixels",
        )  # fmt: skip
    expect(
        whole,
        f"{path}: not a readable OpenEXR image, it was cut off after "
        f"{path.stat().st_size:,} bytes; copy or download it again",
    )
    return parts


def _parts_in(path, data, file):
    """The parts, and whether all their chunks are there."""
    if not data.startswith(_MAGIC):
        kinds = [what for start, what in _SIGNATURES.items() if data.startswith(start)]
        what = kinds[0] if kinds else "something else" if data else "an empty file"
        raise PRTError(
            f"{path}: not a readable OpenEXR image, but {what}; convert it, or correct its name"
        )
    try:
        parts, end, several = _headers(data)
        return parts, all(_is_whole(file, *table, several) for table in _tables(parts, end))
    except (struct.error, IndexError, KeyError, ValueError) as error:
        raise PRTError(
            f"{path}: not a readable OpenEXR image, its header is damaged or cut off; "
            "copy or download it again"
        ) from error


def _headers(data):
    (version,) = struct.unpack_from("<I", data, 4)
    at, parts = 8, []
    while True:
        attributes, at = _attributes(data, at)
        if not attributes:
            break
        parts.append(_part(attributes, version))
        if not version & _SEVERAL:
            break
    return parts, at, bool(version & _SEVERAL)


def _attributes(data, at):
    """{name: bytes} up to the zero byte that ends a header, and where that is."""
    attributes = {}
    while data[at]:
        name, at = _text(data, at)
        _, at = _text(data, at)
        (length,) = struct.unpack_from("<I", data, at)
        at += 4
        if at + length > len(data):
            raise ValueError(name)
        attributes[name] = data[at : at + length]
        at += length
    return attributes, at + 1


def _text(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode("utf-8", "replace"), end + 1


def _part(attributes, version):
    def text(name):
        return attributes.get(name, b"").decode("utf-8", "replace")

    plain = "tiledimage" if "tiles" in attributes else "scanlineimage"
    kind = text("type") or ("deepscanline" if version & _DEEP else plain)
    window = struct.unpack("<4i", attributes["dataWindow"])
    chunks = None
    if kind == "scanlineimage":
        lines = _LINES.get(attributes["compression"][0])
        chunks = lines and -(-(window[3] - window[1] + 1) // lines)
    if "chunkCount" in attributes:
        (chunks,) = struct.unpack("<i", attributes["chunkCount"])
    colours = attributes.get("chromaticities")
    return Part(
        text("name"),
        kind,
        text("view"),
        _channels(attributes["channels"]),
        window,
        struct.unpack("<4i", attributes["displayWindow"]),
        struct.unpack("<8f", colours) if colours else None,
        chunks,
    )


def _channels(data):
    at, channels = 0, {}
    while data[at]:
        name, at = _text(data, at)
        kind, x, y = struct.unpack_from("<i4xii", data, at)
        if x < 1 or y < 1:
            raise ValueError(name)
        channels[name] = kind, x, y
        at += 16
    return channels


def _tables(parts, at):
    """Where each part's table of chunks begins, and how many it has, as far as that is known."""
    for part in parts:
        if part.chunks is None or part.chunks < 0:
            return
        yield at, part.chunks
        at += 8 * part.chunks


def _is_whole(file, at, chunks, several):
    """Whether the last chunk of a table ends in the file; what is unfinished has zeros there."""
    size = file.seek(0, 2)
    file.seek(at)
    offsets = struct.unpack(f"<{chunks}Q", file.read(8 * chunks))
    if not offsets or not all(0 < offset < size for offset in offsets):
        return not offsets
    # Number of the part, first row, bytes; deep chunks and tiles are longer still.
    file.seek(max(offsets) + 4 * several + 4)
    (packed,) = struct.unpack("<i", file.read(4))
    return file.tell() + packed <= size
