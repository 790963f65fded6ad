import numpy as np
import pytest

from prt_core.basis import ImageWavelet, PointHaar
from prt_core.compress import ArrayRows, TransportRows, Wavelet4D
from tests.core.compress.conftest import relative


@pytest.fixture(scope="module")
def rows(transport):
    return TransportRows(transport, 80)


@pytest.fixture(scope="module")
def hierarchy(scene):
    return PointHaar(scene.points.positions, scene.points.normals, scene.points.object_index)


@pytest.mark.parametrize("mode", ["adaptive", "4d", "2d"])
def test_every_term_unquantised_is_exact(rows, hierarchy, light, mode):
    model = Wavelet4D(hierarchy, n_column_terms=rows.n_points, mode=mode, bits=None).fit(rows)
    matrix = rows.block(np.arange(rows.n_points))
    truth = np.einsum("pdc,dc->pc", matrix.astype(np.float64), light)
    assert relative(model.relight(light), truth) < 1e-4


def test_the_error_asked_for_is_kept_and_adaptive_is_never_the_largest(rows, hierarchy):
    sizes = {}
    for mode in ("adaptive", "4d", "2d"):
        model = Wavelet4D(hierarchy, error=0.05, mode=mode, bits=None).fit(rows)
        # The threshold comes from a sample of the columns.
        assert 0.04 < model.matrix_error_ < 0.056
        sizes[mode] = model.n_coefficients_
    assert sizes["adaptive"] <= min(sizes["4d"], sizes["2d"])


def test_rate_and_distortion_are_monotone(rows, hierarchy):
    models = [Wavelet4D(hierarchy, error=e, bits=None).fit(rows) for e in (0.1, 0.03, 0.01)]
    counts = [m.n_coefficients_ for m in models]
    assert counts == sorted(counts) and counts[0] < counts[-1]
    errors = [m.matrix_error_ for m in models]
    assert errors == sorted(errors, reverse=True)


def test_nine_bits_add_little(transport, rows, hierarchy, light):
    light = np.minimum(light, 2)
    truth = transport.relight(light)
    fine = Wavelet4D(hierarchy, error=0.02, bits=None).fit(rows)
    coarse = Wavelet4D(hierarchy, error=0.02, bits=9).fit(rows)
    one, two = (relative(m.relight(light), truth) for m in (fine, coarse))
    assert two < 1.3 * one + 1e-3 and coarse.nbytes < fine.nbytes


@pytest.mark.parametrize("wavelet", ["haar", "5/3", "9/7"])
def test_columns_on_images(wavelet):
    rng = np.random.default_rng(3)
    matrix = rng.random((64, 96, 3)).astype(np.float32)
    matrix[5] = 0
    model = Wavelet4D(ImageWavelet((8, 8), wavelet), n_column_terms=64, bits=None)
    model.fit(ArrayRows(matrix, 4))
    light = rng.random((96, 3)).astype(np.float32)
    truth = np.einsum("pdc,dc->pc", matrix, light)
    assert relative(model.relight(light), truth) < 1e-4
