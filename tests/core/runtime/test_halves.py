import numpy as np

from prt_core.runtime.halves import halves, wholes


def test_halves_keep_the_range_and_eight_bits():
    rng = np.random.default_rng(1)
    values = np.exp(rng.uniform(-60, 60, 10_000)).astype(np.float32)
    back = wholes(halves(values))
    assert back.dtype == np.float32
    assert np.abs(back / values - 1).max() <= 2.0**-8
    # Rounded, not cut: no bias.
    assert abs((back / values - 1).mean()) < 1e-4


def test_what_eight_bits_hold_comes_back_as_it_was():
    values = np.array([[0, 1, 0.5], [255, 1e5 - 1e5 % 512, 3]], np.float32)
    values[1, 1] = wholes(halves(values[1, 1:2]))[0]
    np.testing.assert_array_equal(wholes(halves(values)), values)
