import io

import numpy as np
from PIL import Image

from prt_core.evaluate import write_png


def test_a_png_is_read_back_as_it_was(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)
    write_png(tmp_path / "picture.png", pixels)
    with Image.open(io.BytesIO((tmp_path / "picture.png").read_bytes())) as picture:
        picture.load()
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(picture), pixels)
