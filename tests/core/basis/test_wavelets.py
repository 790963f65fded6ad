import numpy as np
import pytest
import pywt

from prt_core import PRTError
from prt_core.basis import ORTHONORMAL, WAVELETS, ImageWavelet, PointHaar, haar_rows, wavelet_rows

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("wavelet", WAVELETS)
@pytest.mark.parametrize("shape", [(8, 8), (16, 4), (12, 20), (2, 2), (5, 7), (96, 160)])
def test_images_come_back(wavelet, shape):
    transform = ImageWavelet(shape, wavelet)
    images = RNG.standard_normal((3, transform.n))
    for depth in range(transform.depth + 1):
        coefficients = transform.forward(images, depth)
        assert np.abs(transform.inverse(coefficients, depth) - images).max() < 1e-11
    narrow = images.astype(np.float32)
    assert np.abs(transform.inverse(transform.forward(narrow)) - narrow).max() < 2e-5


@pytest.mark.parametrize("wavelet", ORTHONORMAL)
def test_orthonormal_to_rounding(wavelet):
    # PyWavelets' published Daubechies filters are orthonormal to about 1e-12.
    transform = ImageWavelet((8, 8), wavelet)
    basis = transform.forward(np.eye(64))
    assert np.abs(basis @ basis.T - np.eye(64)).max() < 2e-11


@pytest.mark.parametrize("wavelet", WAVELETS)
def test_constant_images_have_no_details(wavelet):
    transform = ImageWavelet((16, 16), wavelet)
    coefficients = transform.forward(np.full((1, 256), 3.0))[0]
    details = transform.scales(transform.depth) > 0
    assert np.abs(coefficients[details]).max() < 1e-10
    assert coefficients[~details] == pytest.approx(3.0 * 16, rel=1e-10)


@pytest.mark.parametrize("wavelet", ["haar", "d4", "d8"])
@pytest.mark.parametrize("n", [16, 96])
def test_a_step_is_pywavelets_up_to_shift_and_order(wavelet, n):
    image = RNG.standard_normal((n, n))
    ours = ImageWavelet((n, n), wavelet).forward(image.reshape(1, -1), 1).reshape(n, n)
    theirs, _ = pywt.dwt2(image, WAVELETS[wavelet], mode="periodization")
    ours = ours[: n // 2, : n // 2]
    np.testing.assert_allclose(np.sort(ours.ravel()), np.sort(theirs.ravel()), atol=1e-10)


def test_smooth_images_are_sparser_in_smoother_wavelets():
    v, u = np.mgrid[0:32, 0:32] / 32
    image = np.sin(3 * u + v * v)
    rest = {}
    for wavelet in ("haar", "5/3", "9/7"):
        transform = ImageWavelet((32, 32), wavelet)
        squares = np.sort(transform.forward(image.reshape(1, -1), 3)[0] ** 2)
        rest[wavelet] = squares[:-40].sum()
    assert rest["9/7"] < rest["5/3"] < rest["haar"]


def test_haar_rows_are_the_same_both_ways():
    rows = RNG.standard_normal((2, 6 * 64))
    ours, quick = wavelet_rows(rows, 8, "haar"), haar_rows(rows, 8)
    np.testing.assert_allclose(np.sort(np.abs(ours)), np.sort(np.abs(quick)), atol=1e-12)
    np.testing.assert_allclose(wavelet_rows(ours, 8, "haar", inverse=True), rows, atol=1e-12)
    with pytest.raises(PRTError, match="wavelet"):
        wavelet_rows(rows, 8, "9/7")
    with pytest.raises(PRTError, match="wavelet"):
        ImageWavelet((8, 8), "db20")


@pytest.mark.parametrize("n", [1, 2, 3, 7, 64, 101])
def test_points_come_back_and_are_orthonormal(n):
    transform = PointHaar(RNG.standard_normal((n, 3)), RNG.standard_normal((n, 3)))
    assert sorted(transform.order) == list(range(n))
    functions = RNG.standard_normal((4, n))
    for depth in range(transform.depth + 1):
        coefficients = transform.forward(functions, depth)
        assert np.abs(transform.inverse(coefficients, depth) - functions).max() < 1e-12
        assert len(transform.scales(depth)) == n
    basis = transform.forward(np.eye(n))
    assert np.abs(basis @ basis.T - np.eye(n)).max() < 1e-12


def test_a_constant_on_points_is_one_coefficient():
    transform = PointHaar(RNG.standard_normal((37, 3)))
    coefficients = transform.forward(np.full((1, 37), 2.0))[0]
    assert (np.abs(coefficients) > 1e-12).sum() == 1
    assert coefficients[0] == pytest.approx(2 * np.sqrt(37))


def test_patches_are_compact_and_keep_to_their_object():
    positions = RNG.random((256, 3)) * [1, 1, 0]
    groups = np.repeat([0, 1], 128)
    transform = PointHaar(positions, groups=groups)
    leaves = positions[transform.order].reshape(32, 8, 3)
    spread = np.ptp(leaves, axis=1).max(axis=1)
    assert np.median(spread) < 0.45
    assert (groups[transform.order].reshape(2, 128) == [[0], [1]]).all()
