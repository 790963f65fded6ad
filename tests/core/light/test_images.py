import numpy as np
import OpenEXR
import pytest

from prt_core import PRTError
from prt_core.light import EnvironmentMap, read_image, write_image

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
    found = read_image(tmp_path / "y.exr")
    for channel in range(3):
        np.testing.assert_array_equal(found[..., channel], PIXELS[..., 0])


def test_several_parts_and_layers(tmp_path):
    depth = OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"Z": PIXELS[..., 0].copy()}, "depth")
    colour = OpenEXR.Part(
        {"type": OpenEXR.scanlineimage},
        {f"View.Combined.{c}": PIXELS[..., i].copy() for i, c in enumerate("RGB")},
        "colour",
    )
    with OpenEXR.File([depth, colour]) as file:
        file.write(str(tmp_path / "parts.exr"))
    np.testing.assert_array_equal(read_image(tmp_path / "parts.exr"), PIXELS)


def test_errors_name_file_and_reason(tmp_path):
    with pytest.raises(PRTError, match="no such image"):
        read_image(tmp_path / "none.exr")
    (tmp_path / "bad.exr").write_bytes(b"not an image")
    with pytest.raises(PRTError, match="bad.exr: not a readable OpenEXR"):
        read_image(tmp_path / "bad.exr")
    save(tmp_path / "z.exr", {"Z": PIXELS[..., 0].copy()})
    with pytest.raises(PRTError, match="no R, G, B or Y channels; it has Z"):
        read_image(tmp_path / "z.exr")
    (tmp_path / "a.jpg").write_bytes(b"")
    with pytest.raises(PRTError, match="expected an .exr or .hdr"):
        read_image(tmp_path / "a.jpg")
    write_image(tmp_path / "wide.exr", PIXELS)
    with pytest.raises(PRTError, match="twice as wide as high, got 11 x 5"):
        EnvironmentMap.read(tmp_path / "wide.exr")
    bad = PIXELS.copy()
    bad[1, 2, 0] = np.inf
    save(tmp_path / "inf.exr", {"RGB": bad})
    with pytest.raises(PRTError, match="1 pixels are NaN or infinite"):
        read_image(tmp_path / "inf.exr")
