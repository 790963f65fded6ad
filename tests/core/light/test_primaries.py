import numpy as np
import OpenEXR
import pytest

from prt_core import PRTError
from prt_core.light import EnvironmentMap, read_image, read_picture
from prt_core.light.primaries import REC709, to_rec709

REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
ACES_AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
# ITU-R BT.2087, table 2, the other way round; ACES S-2014-004 with Bradford to D65.
FROM_2020 = [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]
FROM_AP0 = [[2.5217, -1.1341, -0.3876], [-0.2765, 1.3727, -0.0962], [-0.0154, -0.1530, 1.1684]]


@pytest.mark.parametrize(("given", "wanted"), [(REC2020, FROM_2020), (ACES_AP0, FROM_AP0)])
def test_the_matrices_are_the_published_ones(given, wanted):
    matrix = to_rec709("a", given)
    np.testing.assert_allclose(matrix, wanted, atol=2e-4)
    # What is white stays white.
    np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-3)


def test_rec709_is_left_as_it_is():
    assert to_rec709("a", REC709) is None
    # As float32, and rounded.
    assert to_rec709("a", np.float32(REC709)) is None
    assert to_rec709("a", (*REC709[:6], 0.313, 0.329)) is None
    assert to_rec709("a", (0.0,) * 8) is None
    # As in an ICC profile, relative to D50: in files that come with Blender.
    profile = (0.64845, 0.33088, 0.32119, 0.59789, 0.1559, 0.06606, 0.34571, 0.35854)
    assert to_rec709("a", profile) is None
    # Another white alone is another picture: adapted, so that it stays white.
    assert to_rec709("a", (*REC709[:6], 0.34571, 0.35854)) is not None


@pytest.mark.parametrize("bad", [(0.3, 0.3) * 4, (*REC709[:7], np.nan), (*REC709[:7], 0.0)])
def test_what_are_no_primaries_is_said(bad):
    with pytest.raises(PRTError, match="a: its primaries .* are none"):
        to_rec709("a", bad)


def test_an_image_of_other_primaries_is_converted_and_said(tmp_path):
    pixels = np.random.default_rng(0).random((3, 6, 3)).astype(np.float32) * 0.2 + 0.4
    # Outside Rec.709: a green that only AP0 has.
    pixels[2, 5] = 0, 1, 0
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    for name, chromaticities in (("aces", ACES_AP0), ("plain", REC709)):
        with OpenEXR.File({**header, "chromaticities": chromaticities}, {"RGB": pixels}) as file:
            file.write(str(tmp_path / f"{name}.exr"))
    np.testing.assert_array_equal(read_image(tmp_path / "plain.exr"), pixels)
    result, notes = read_picture(tmp_path / "aces.exr")
    wanted = np.maximum(pixels @ np.transpose(FROM_AP0), 0)
    np.testing.assert_allclose(result, wanted, atol=1e-3)
    assert len(notes) == 1 and "converted from the primaries" in notes[0]
    assert (wanted[2, 5] == 0).sum() == 2 and EnvironmentMap.read(tmp_path / "aces.exr").notes
