"""Wavelet filters against the lifting steps and closed forms they are defined by."""

import numpy as np
import pytest

from prt_core.basis import ImageWavelet
from prt_core.basis.wavelets import step_matrices

RNG = np.random.default_rng(6)
SIZES = [2, 4, 6, 10, 22]


def mirrored(x, k):
    """Sample k of a signal that is mirrored about its first and last sample."""
    period = 2 * len(x) - 2
    k = abs(k) % period
    return x[k if k < len(x) else period - k]


def lifted(x, steps):
    """Even and odd samples after lifting: each step adds to one kind its two neighbours' share."""
    x = np.array(x, np.float64)
    for first, share in steps:
        before = x.copy()
        for k in range(first, len(x), 2):
            x[k] += share * (mirrored(before, k - 1) + mirrored(before, k + 1))
    return x[0::2], x[1::2]


# JPEG 2000, part 1, annex F; even samples end as scaling coefficients.
LIFTING = {
    "5/3": [(1, -1 / 2), (0, 1 / 4)],
    "9/7": [
        (1, -1.586134342059924),
        (0, -0.052980118572961),
        (1, 0.882911075530934),
        (0, 0.443506852043971),
    ],
}
# Of a constant the scaling coefficients are sqrt(2) times it.
SCALES = {"5/3": (np.sqrt(2), 1 / np.sqrt(2)), "9/7": (1.149604398860241, 1 / 1.149604398860241)}


@pytest.mark.parametrize("wavelet", LIFTING)
@pytest.mark.parametrize("n", SIZES)
def test_biorthogonal_steps_are_those_of_jpeg_2000(wavelet, n):
    forward, inverse = step_matrices(n, wavelet)
    low, high = SCALES[wavelet]
    for _ in range(3):
        x = RNG.standard_normal(n)
        even, odd = lifted(x, LIFTING[wavelet])
        result = forward @ x
        np.testing.assert_allclose(result[: n // 2], low * even, atol=1e-9)
        np.testing.assert_allclose(np.abs(result[n // 2 :]), np.abs(high * odd), atol=1e-9)
        np.testing.assert_allclose(inverse @ result, x, atol=1e-9)


@pytest.mark.parametrize("wavelet, moments", [("haar", 1), ("d4", 2), ("d6", 3), ("d8", 4),
                                              ("5/3", 2), ("9/7", 4)])  # fmt: skip
def test_details_of_polynomials_vanish_as_often_as_they_should(wavelet, moments):
    n = 40
    forward, _ = step_matrices(n, wavelet)
    place = np.arange(n) / n
    inside = slice(n // 2 + 5, n - 5)
    for power in range(moments + 1):
        details = np.abs(forward @ place**power)[inside]
        if power < moments:
            assert details.max() < 1e-9
        else:
            assert details.min() > 1e-9
    np.testing.assert_allclose((forward @ np.ones(n))[: n // 2], np.sqrt(2))


def test_daubechies_taps_are_the_closed_form():
    root = np.sqrt(3)
    taps = np.array([1 + root, 3 + root, 3 - root, 1 - root]) / (4 * np.sqrt(2))
    forward, _ = step_matrices(8, "d4")
    low, high = np.sort(np.abs(forward[1])), np.sort(np.abs(forward[5]))
    np.testing.assert_allclose(low[-4:], np.sort(np.abs(taps)))
    np.testing.assert_allclose(high[-4:], np.sort(np.abs(taps)))
    assert not low[:-4].any()
    # Neighbours overlap by two samples, the last one with the first.
    support = [set(np.flatnonzero(row)) for row in forward[:4]]
    assert all(len(support[k] & support[(k + 1) % 4]) == 2 for k in range(4))


@pytest.mark.parametrize("wavelet", ["haar", "d4", "d6", "d8", "5/3", "9/7"])
def test_a_step_of_an_image_is_one_along_rows_and_one_along_columns(wavelet):
    height, width = 12, 20
    image = RNG.standard_normal((height, width))
    down, across = step_matrices(height, wavelet)[0], step_matrices(width, wavelet)[0]
    result = ImageWavelet((height, width), wavelet).forward(image.reshape(1, -1), 1)
    np.testing.assert_allclose(result.reshape(height, width), down @ image @ across.T, atol=1e-12)


@pytest.mark.parametrize("wavelet", ["haar", "d6", "5/3", "9/7"])
def test_weights_are_the_energies_of_what_coefficients_stand_for(wavelet):
    transform = ImageWavelet((64, 128), wavelet)
    depth = 2
    weights, scales = transform.weights(depth), transform.scales(depth)
    # The middle of every band, away from the borders, where functions are cut.
    places = [(8, 16), (8, 48), (24, 16), (24, 48), (16, 96), (48, 32), (48, 96)]
    places = [128 * row + column for row, column in places]
    for place in places:
        one = np.zeros((1, transform.n))
        one[0, place] = 1
        energy = (transform.inverse(one, depth) ** 2).sum()
        assert weights[place] == pytest.approx(energy, rel=1e-5), place
    np.testing.assert_array_equal(scales[places], [0, 1, 1, 1, 2, 2, 2])


def test_levels_of_coefficients_count_from_the_coarsest():
    transform = ImageWavelet((8, 4), "haar")
    assert transform.depth == 2
    wanted = np.full((8, 4), 2)
    wanted[:4, :2] = 1
    wanted[:2, :1] = 0
    np.testing.assert_array_equal(transform.scales(2).reshape(8, 4), wanted)
    np.testing.assert_array_equal(transform.scales(0), np.zeros(32))
