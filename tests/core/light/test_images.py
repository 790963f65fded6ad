import struct
import sys

import numpy as np
import OpenEXR
import pytest

from prt_core import PRTError
from prt_core.light import EnvironmentMap, images, read_image, read_picture, write_image
from tests.exr import attribute, exr_lines, exr_mip

RNG = np.random.default_rng(0)
PIXELS = RNG.random((5, 11, 3)).astype(np.float32)


def save(path, channels, header=None):
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        **(header or {}),
    }
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))


def test_round_trip_is_exact(tmp_path):
    write_image(tmp_path / "a.exr", PIXELS)
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), PIXELS)


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_half_float_and_alpha(tmp_path, dtype):
    stored = PIXELS.astype(dtype)
    rgba = np.concatenate([stored, np.ones_like(stored[..., :1])], axis=-1)
    save(tmp_path / "a.exr", {"RGBA": rgba})
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), stored.astype(np.float32))


def test_luminance_only_is_grey(tmp_path):
    save(tmp_path / "y.exr", {"Y": np.ascontiguousarray(PIXELS[..., 0])})
    result = read_image(tmp_path / "y.exr")
    for channel in range(3):
        np.testing.assert_array_equal(result[..., channel], PIXELS[..., 0])


def layers(*names):
    """Channels of layers; the third is 20 brighter than the first."""
    return {
        f"{name}.{c}" if name else c: PIXELS[..., i] + np.float32(10 * j)
        for j, name in enumerate(names)
        for i, c in enumerate("RGB")
    }


def save_parts(path, *names):
    """Parts that hold one layer each, like `layers`."""
    result = [
        OpenEXR.Part(
            {"type": OpenEXR.scanlineimage},
            {c: PIXELS[..., i] + np.float32(10 * j) for i, c in enumerate("RGB")},
            name,
        )
        for j, name in enumerate(names)
    ]
    with OpenEXR.File(result) as file:
        file.write(str(path))


def test_uint_pixels_are_numbers(tmp_path):
    planes = {c: (1000 * PIXELS[..., i]).astype(np.uint32) for i, c in enumerate("RGB")}
    (tmp_path / "u.exr").write_bytes(exr_lines([(c, 0, 1, 1) for c in "RGB"], planes, 11, 5))
    result = read_image(tmp_path / "u.exr")
    np.testing.assert_array_equal(result, np.floor(1000 * PIXELS))


def test_tiles_and_mip_levels(tmp_path):
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize = 4, 3
    save(tmp_path / "t.exr", {"RGB": PIXELS}, {"type": OpenEXR.tiledimage, "tiles": tiles})
    np.testing.assert_array_equal(read_image(tmp_path / "t.exr"), PIXELS)
    planes = {c: PIXELS[..., i] for i, c in enumerate("RGB")}
    (tmp_path / "m.exr").write_bytes(exr_mip(planes, 11, 5))
    np.testing.assert_array_equal(read_image(tmp_path / "m.exr"), PIXELS)


def test_a_data_window_is_placed_and_cut(tmp_path):
    """Stored are columns -2 to 8 and rows 1 to 5 of an image of 10 x 4."""
    windows = {
        "dataWindow": (np.int32([-2, 1]), np.int32([8, 5])),
        "displayWindow": (np.int32([0, 0]), np.int32([9, 3])),
    }
    save(tmp_path / "w.exr", {"RGB": PIXELS}, windows)
    wanted = np.zeros((4, 10, 3), np.float32)
    wanted[1:, :9] = PIXELS[:3, 2:]
    np.testing.assert_array_equal(read_image(tmp_path / "w.exr"), wanted)


@pytest.mark.parametrize(
    ("names", "taken"),
    [
        (("ViewLayer.AO", "ViewLayer.Combined", "ViewLayer.DiffCol"), 1),
        (("AO", "", "Combined"), 1),
        (("A.Combined", ""), 1),
        (("Another.Combined", "View.Combined"), 0),
        (("Diffuse", "beauty"), 1),
        (("View.AO",), 0),
    ],
)
def test_the_main_layer_is_read_and_named(tmp_path, names, taken):
    save(tmp_path / "l.exr", layers(*names))
    pixels, notes = read_picture(tmp_path / "l.exr")
    np.testing.assert_array_equal(pixels, PIXELS + np.float32(10 * taken))
    if len(names) == 1:
        assert notes == []
    else:
        assert len(notes) == 1 and (names[taken] or "plain R, G, B") in notes[0]
        assert all(name in notes[0] for name in names if name)


@pytest.mark.parametrize(
    ("names", "taken"),
    [(("ViewLayer.AO", "ViewLayer.Combined"), 1), (("depth", "rgba"), 1), (("only",), 0)],
)
def test_the_main_part_is_read_and_named(tmp_path, names, taken):
    save_parts(tmp_path / "p.exr", *names)
    pixels, notes = read_picture(tmp_path / "p.exr")
    np.testing.assert_array_equal(pixels, PIXELS + np.float32(10 * taken))
    assert [names[taken] in note for note in notes] == [True] * (len(names) > 1)


def test_of_two_views_the_first_is_read(tmp_path):
    parts = [
        OpenEXR.Part(
            {"type": OpenEXR.scanlineimage, "view": view},
            {c: PIXELS[..., i] + np.float32(10 * j) for i, c in enumerate("RGB")},
            f"{name}{view}",
        )
        for name in ("AO.", "Combined.")
        for j, view in enumerate(("left", "right"), start=len(name))
    ]
    with OpenEXR.File(parts) as file:
        file.write(str(tmp_path / "v.exr"))
    pixels, notes = read_picture(tmp_path / "v.exr")
    np.testing.assert_array_equal(pixels, PIXELS + np.float32(10 * len("Combined.")))
    assert "read is Combined" in notes[0]


def test_parts_without_colour_are_no_choice(tmp_path):
    depth = OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"Z": PIXELS[..., 0].copy()}, "depth")
    colour = OpenEXR.Part({"type": OpenEXR.scanlineimage}, layers("View.Combined"), "colour")
    with OpenEXR.File([depth, colour]) as file:
        file.write(str(tmp_path / "parts.exr"))
    pixels, notes = read_picture(tmp_path / "parts.exr")
    np.testing.assert_array_equal(pixels, PIXELS)
    assert notes == []


def test_layers_of_which_none_is_the_main_one_are_refused(tmp_path):
    save(tmp_path / "l.exr", layers("AO", "Diffuse", "Glossy"))
    with pytest.raises(PRTError, match="layers AO, Diffuse, Glossy, and none is called Combined"):
        read_image(tmp_path / "l.exr")


def test_the_choice_stays_with_the_light(tmp_path):
    square = np.concatenate([PIXELS[:4, :8]])
    save(tmp_path / "l.exr", {f"{n}.{c}": square[..., i].copy() for i, c in enumerate("RGB")
                              for n in ("A.AO", "A.Combined")})  # fmt: skip
    assert "A.Combined" in EnvironmentMap.read(tmp_path / "l.exr").notes[0]


def test_kinds_that_would_be_another_picture_are_refused(tmp_path):
    half = PIXELS[:4, :10].copy()
    planes = {"Y": half[..., 0], "RY": half[::2, ::2, 1], "BY": half[::2, ::2, 2]}
    chroma = [("Y", 1, 1, 1), ("RY", 1, 2, 2), ("BY", 1, 2, 2)]
    (tmp_path / "yc.exr").write_bytes(exr_lines(chroma, planes, 10, 4))
    with pytest.raises(PRTError, match="luminance and chroma .* are not understood"):
        read_image(tmp_path / "yc.exr")
    for names in ("XYZ", "XY", ("N.X", "N.Y", "N.Z")):
        save(tmp_path / "n.exr", {name: half[..., i].copy() for i, name in enumerate(names)})
        with pytest.raises(PRTError, match="vectors or CIE colours .* are not understood"):
            read_image(tmp_path / "n.exr")
    planes = {"R": half[::2, ::2, 0], "G": half[..., 1], "B": half[..., 2]}
    few = [("R", 2, 2, 2), ("G", 2, 1, 1), ("B", 2, 1, 1)]
    (tmp_path / "s.exr").write_bytes(exr_lines(few, planes, 10, 4))
    with pytest.raises(PRTError, match="sub-sampling"):
        read_image(tmp_path / "s.exr")
    deep = np.empty((3, 5), object)
    for place in np.ndindex(deep.shape):
        deep[place] = np.float32([1, 2])
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    save(tmp_path / "d.exr", dict.fromkeys("RGB", deep), header)
    with pytest.raises(PRTError, match="deep images are not understood"):
        read_image(tmp_path / "d.exr")


def test_a_file_that_is_something_else_is_said(tmp_path):
    for start, what in ((b"\x89PNG\r\n", "a PNG image"), (b"\xff\xd8\xff\xe0", "a JPEG image"),
                        (b"", "an empty file"), (b"<!doctype html>", "a web page"),
                        (b"#?RADIANCE", "a Radiance image")):  # fmt: skip
        (tmp_path / "a.exr").write_bytes(start)
        with pytest.raises(PRTError, match=f"not a readable OpenEXR image, but {what}"):
            read_image(tmp_path / "a.exr")
    for name in ("a.png", "a.jpg", "a"):
        (tmp_path / name).write_bytes(b"")
        with pytest.raises(PRTError, match="expected an .exr or .hdr"):
            read_image(tmp_path / name)


@pytest.mark.parametrize("compression", [OpenEXR.ZIP_COMPRESSION, OpenEXR.NO_COMPRESSION])
def test_a_file_that_was_cut_off_is_said(tmp_path, compression, capfd):
    path, pixels = tmp_path / "a.exr", RNG.random((70, 140, 3)).astype(np.float32)
    save(path, {"RGB": pixels}, {"compression": compression})
    data = path.read_bytes()
    for length in (3, 30, 250, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:length])
        with pytest.raises(PRTError, match="cut off|empty|something else"):
            read_image(path)
    # Found in the header, before a decoder prints lines of its own.
    assert capfd.readouterr() == ("", "")
    path.write_bytes(data)
    np.testing.assert_array_equal(read_image(path), pixels)


def test_pixels_that_cannot_be_decoded_are_one_line(tmp_path, capfd):
    pixels = RNG.random((70, 140, 3)).astype(np.float32)
    save(tmp_path / "a.exr", {"RGB": pixels})
    data = bytearray((tmp_path / "a.exr").read_bytes())
    # More than sixteen rows, so that the head of a chunk is among them.
    data[len(data) // 2 : len(data) // 2 + 27_000] = b"\xaa" * 27_000
    (tmp_path / "a.exr").write_bytes(data)
    with pytest.raises(PRTError, match="not a readable OpenEXR image"):
        read_image(tmp_path / "a.exr")
    # OpenEXR's own lines are not shown, and those of others are again.
    print("out")
    print("err", file=sys.stderr)
    assert capfd.readouterr() == ("out\n", "err\n")


def test_an_image_without_pixels_or_beyond_memory_is_refused(tmp_path, monkeypatch):
    planes = {c: PIXELS[..., i] for i, c in enumerate("RGB")}
    data = exr_lines([(c, 2, 1, 1) for c in "RGB"], planes, 11, 5)
    display = attribute("displayWindow", "box2i", struct.pack("<4i", 0, 0, 10, 4))
    none = attribute("displayWindow", "box2i", struct.pack("<4i", 0, 0, -1, 4))
    (tmp_path / "n.exr").write_bytes(data.replace(display, none))
    with pytest.raises(PRTError, match="the image has no pixels"):
        read_image(tmp_path / "n.exr")
    huge = attribute("displayWindow", "box2i", struct.pack("<4i", 0, 0, 1 << 20, 1 << 20))
    (tmp_path / "h.exr").write_bytes(data.replace(display, huge))
    with pytest.raises(PRTError, match="GB of memory, there are"):
        read_image(tmp_path / "h.exr")


def test_a_header_in_pieces_is_one_line(tmp_path, monkeypatch):
    """Bytes of a small header in turn: read the same, or refused in one line."""
    monkeypatch.setattr("prt_core.runtime.machine.memory_bytes", lambda: 1 << 24)
    planes = {c: PIXELS[..., i] for i, c in enumerate("RGB")}
    data = exr_lines([(c, 2, 1, 1) for c in "RGB"], planes, 11, 5)
    for place in range(4, 320, 3):
        (tmp_path / "a.exr").write_bytes(data[:place] + b"\xff" + data[place + 1 :])
        try:
            assert read_image(tmp_path / "a.exr").ndim == 3
        except PRTError as error:
            assert "\n" not in str(error)


def test_what_is_to_be_repaired_is_said(tmp_path):
    bad = PIXELS.copy()
    bad[1, 2, 0], bad[3, 4, 1] = np.inf, np.nan
    save(tmp_path / "inf.exr", {"RGB": bad})
    with pytest.raises(PRTError) as caught:
        read_image(tmp_path / "inf.exr")
    assert "2 pixels are NaN or infinite, the first at column 2, row 1" in str(caught.value)
    assert "oiiotool inf.exr --fixnan" in str(caught.value)
    bad[1, 2, 0], bad[3, 4, 1] = -3, 0
    with pytest.raises(PRTError, match="1 pixels are negative, the first at column 2, row 1"):
        EnvironmentMap(bad)
    bad[1, 2, 0], bad[3, 4, 1] = 0, 3e38
    with pytest.raises(PRTError, match="largest value is 3e.38; 1 pixels are brighter, .*column 4"):
        EnvironmentMap(bad)


def test_errors_name_file_and_reason(tmp_path):
    with pytest.raises(PRTError, match="no such image"):
        read_image(tmp_path / "none.exr")
    with pytest.raises(PRTError, match="no such image"):
        read_image(tmp_path)
    save(tmp_path / "z.exr", {"Z": PIXELS[..., 0].copy()})
    with pytest.raises(PRTError, match="no R, G, B or Y channels; it has Z"):
        read_image(tmp_path / "z.exr")
    write_image(tmp_path / "wide.exr", PIXELS)
    with pytest.raises(PRTError, match="twice as wide as high, got 11 x 5"):
        EnvironmentMap.read(tmp_path / "wide.exr")


def test_a_reader_from_outside_gets_plain_images_only(tmp_path, monkeypatch):
    """Blender's reader, where it is lent, knows neither layers nor primaries."""
    monkeypatch.setattr(images, "_READERS", {".exr": lambda path: PIXELS})
    save(tmp_path / "a.exr", {"RGB": PIXELS})
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), PIXELS)
    save(tmp_path / "l.exr", layers("V.AO", "V.Combined"))
    with pytest.raises(PRTError, match="Blender reads no layers here; save V.Combined alone"):
        read_image(tmp_path / "l.exr")
