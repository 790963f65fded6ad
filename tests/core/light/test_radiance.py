import numpy as np
import pytest

from prt_core import PRTError
from prt_core.light import EnvironmentMap, read_image, read_picture

RNG = np.random.default_rng(4)


def shared(pixels):
    """(height, width, 4) uint8: mantissas and their exponent."""
    most = pixels.max(axis=-1)
    exponent = np.where(most > 0, np.floor(np.log2(np.maximum(most, 1e-30))) + 1 + 128, 0)
    scale = np.where(most > 0, np.exp2(136 - np.maximum(exponent, 9)), 0)
    return np.concatenate([np.floor(pixels * scale[..., None]), exponent[..., None]], -1).astype(
        np.uint8
    )


def runs(row):
    """One component of a row in runs of at least three, and pieces of others."""
    result, at = b"", 0
    while at < len(row):
        same = 1
        while at + same < len(row) and same < 127 and row[at + same] == row[at]:
            same += 1
        if same > 2:
            result += bytes([128 + same, row[at]])
        else:
            same = min(2, len(row) - at)
            result += bytes([same]) + row[at : at + same].tobytes()
        at += same
    return result


def coded(pixels):
    """The newer run-length code."""
    width = pixels.shape[1]
    return b"".join(
        bytes([2, 2, width >> 8, width & 255]) + b"".join(runs(part) for part in row.T)
        for row in shared(pixels)
    )


def save(path, data, size="-Y 6 +X 12", lines=(), form="32-bit_rle_rgbe"):
    head = "\n".join(["#?RADIANCE", f"FORMAT={form}", *lines])
    path.write_bytes(f"{head}\n\n{size}\n".encode() + data)
    return path


# Exact in eight bits of mantissa; some of it in runs, some black.
PIXELS = (RNG.integers(128, 256, (6, 12, 3)) / 64).astype(np.float32)
PIXELS[2, 3:9], PIXELS[4] = 0, 2.5


@pytest.mark.parametrize("kind", ["runs", "flat"])
def test_pixels_are_read_as_they_were(tmp_path, kind):
    data = coded(PIXELS) if kind == "runs" else shared(PIXELS).tobytes()
    pixels, notes = read_picture(save(tmp_path / "a.hdr", data))
    np.testing.assert_array_equal(pixels, PIXELS)
    assert pixels.dtype == np.float32 and notes == []
    assert EnvironmentMap.read(tmp_path / "a.hdr").pixels.shape == (6, 12, 3)


def test_without_an_exponent_it_is_black(tmp_path):
    data = shared(PIXELS)
    data[1, 4] = 200, 100, 50, 0
    pixels = read_image(save(tmp_path / "a.hdr", data.tobytes()))
    assert not pixels[1, 4].any() and pixels[1, 5].all()


def test_older_runs(tmp_path):
    """1, 1, 1, n repeats the pixel before n times; a second such line counts 256 each."""
    one, two = shared(PIXELS[:1, :2])[0]
    data = [one, [1, 1, 1, 5], two, [1, 1, 1, 44], [1, 1, 1, 1]]
    pixels = read_image(save(tmp_path / "a.hdr", np.uint8(data).tobytes(), "-Y 3 +X 102"))
    wanted = np.repeat(PIXELS[0, :2], [6, 300], axis=0).reshape(3, 102, 3)
    np.testing.assert_array_equal(pixels, wanted)


@pytest.mark.parametrize(
    ("size", "turned"),
    [
        ("+Y 6 +X 12", PIXELS[::-1]),
        ("-Y 6 -X 12", PIXELS[:, ::-1]),
        ("+Y 6 -X 12", PIXELS[::-1, ::-1]),
    ],
)
def test_orientations(tmp_path, size, turned):
    np.testing.assert_array_equal(read_image(save(tmp_path / "a.hdr", coded(PIXELS), size)), turned)


@pytest.mark.parametrize("size", ["+X 12 -Y 6", "-X 12 +Y 6", "-Y six +X 12", "-Y 6"])
def test_other_orientations_are_refused(tmp_path, size):
    with pytest.raises(PRTError, match="its orientation '.*' is not understood; turn it"):
        read_image(save(tmp_path / "a.hdr", coded(PIXELS), size))


def test_what_the_header_tells_is_said(tmp_path):
    lines = ["EXPOSURE=1.0", "EXPOSURE= 2.5", "COLORCORR=1 1 1", "VIEW= -vta", "# EXPOSURE=7"]
    pixels, notes = read_picture(save(tmp_path / "a.hdr", coded(PIXELS), lines=lines))
    np.testing.assert_array_equal(pixels, PIXELS)
    assert [note.split(": ")[1] for note in notes] == [
        "its EXPOSURE 2.5 is not applied, as in Blender"
    ]
    lines = ["PRIMARIES= 0.708 0.292 0.170 0.797 0.131 0.046 0.3127 0.3290"]
    pixels, notes = read_picture(save(tmp_path / "a.hdr", coded(PIXELS), lines=lines))
    assert "converted from the primaries" in notes[0]
    assert np.abs(pixels - PIXELS).max() > 0.1
    # Grey stays grey.
    np.testing.assert_allclose(pixels[4], 2.5, rtol=2e-3)


def test_xyz_is_refused(tmp_path):
    with pytest.raises(PRTError, match="'32-bit_rle_xyze' is not understood; .*ra_xyze"):
        read_image(save(tmp_path / "a.hdr", coded(PIXELS), form="32-bit_rle_xyze"))


@pytest.mark.parametrize("kind", ["runs", "flat"])
def test_a_file_that_was_cut_off_is_said(tmp_path, kind):
    data = coded(PIXELS) if kind == "runs" else shared(PIXELS).tobytes()
    whole = save(tmp_path / "a.hdr", data).read_bytes()
    for length in (5, 30, 60, len(whole) // 2, len(whole) - 1):
        (tmp_path / "a.hdr").write_bytes(whole[:length])
        with pytest.raises(PRTError, match="cut off|not understood"):
            read_image(tmp_path / "a.hdr")


def test_sizes_and_kinds_that_cannot_be_are_said(tmp_path):
    for size, message in (("-Y 0 +X 12", "no pixels"), ("-Y 999999 +X 999999", "GB of memory")):
        with pytest.raises(PRTError, match=message):
            read_image(save(tmp_path / "a.hdr", coded(PIXELS), size))
    (tmp_path / "a.hdr").write_bytes(b"\x89PNG")
    with pytest.raises(PRTError, match="not a readable Radiance image; convert"):
        read_image(tmp_path / "a.hdr")
    (tmp_path / "a.hdr").write_bytes(b"")
    with pytest.raises(PRTError, match="not a readable Radiance image"):
        read_image(tmp_path / "a.hdr")
