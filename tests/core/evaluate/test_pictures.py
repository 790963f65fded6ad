import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prt_core.errors import PRTError
from prt_core.evaluate import write_png
from prt_core.evaluate.sequence import light_paths


def test_a_png_is_read_back_as_it_was(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)
    write_png(tmp_path / "picture.png", pixels)
    with Image.open(io.BytesIO((tmp_path / "picture.png").read_bytes())) as picture:
        picture.load()
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(picture), pixels)


def test_lights_whose_files_would_be_one_are_refused():
    assert light_paths("a_##.png", ["day", ""]) == {
        "day": Path("a_day_##.png"),
        "": Path("a_##.png"),
    }
    for names in (["Day", "day"], ["a/b", "a:b"], ["lamp", "lamp"]):
        with pytest.raises(PRTError, match=f"of two lights, '{names[0]}' and '{names[1]}'; rename"):
            light_paths("a.png", names)
