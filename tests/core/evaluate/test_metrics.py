import numpy as np
import pytest

from prt_core import PRTError
from prt_core.evaluate.metrics import colour_error
from prt_core.evaluate.png import to_srgb


def test_errors_are_weighed_by_area():
    truth = np.array([[1.0, 2, 2], [0, 3, 4]])
    colours = truth + [[0, 1, 0], [2, 0, 0]]
    plain = colour_error(colours, truth)
    assert plain["l2"] == pytest.approx(np.sqrt((1 + 4) / (9 + 25)))
    assert plain["mean"] == pytest.approx(15 / 12 - 1)
    weighed = colour_error(colours, truth, [3, 1])
    assert weighed["l2"] == pytest.approx(np.sqrt((3 * 1 + 4) / (3 * 9 + 25)))
    assert weighed["mean"] == pytest.approx((3 * 6 + 9) / (3 * 5 + 7) - 1)
    assert colour_error(truth, truth, [3, 1]) == {"l2": 0, "mean": 0}
    assert colour_error(0.5 * truth, truth)["mean"] == pytest.approx(-0.5)
    with pytest.raises(PRTError, match="truth: expected shape"):
        colour_error(truth, truth[:1])


def test_bytes_are_srgb():
    # IEC 61966-2-1: a line near black, a power of 2.4 above it.
    for value, byte in ((0, 0), (1, 255), (2, 255), (-1, 0), (0.5, 188), (0.002, 7), (0.18, 118)):
        assert to_srgb(value) == byte
    np.testing.assert_array_equal(to_srgb([0.125, 0.25], 2), to_srgb([0.5, 1.0]))
    np.testing.assert_array_equal(to_srgb([0.5, 1.0], -1), to_srgb([0.25, 0.5]))
    # To the nearest byte: each byte's own value comes back.
    encoded = np.arange(256) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    np.testing.assert_array_equal(to_srgb(linear), np.arange(256))
