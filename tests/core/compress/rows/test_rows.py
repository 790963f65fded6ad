import numpy as np
import pytest

from prt_core import PRTError
from prt_core.compress import ArrayRows, TransportRows
from prt_core.compress.linalg import orthonormal_columns, principal_rows
from tests.core.compress.conftest import relative

RNG = np.random.default_rng(2)


@pytest.mark.parametrize("natural", [True, False])
def test_rows_of_a_transport_are_its_rows(transport, light, natural):
    rows = TransportRows(transport, rank=200, natural=natural)
    points = np.array([3, 50, 7, 200])
    truth = transport.rows(points)
    result = rows.block(points) * transport.albedo[points, None]
    assert relative(result, truth) < 5e-3
    under = rows.code.products(rows.features(points), rows.code.light(light))
    assert relative(under, transport.product(light)[points]) < 5e-3


def test_direct_rows_are_exact(transport):
    rows = TransportRows(transport, rank=0)
    points = np.arange(0, rows.n_points, 9)
    result = rows.block(points) * transport.albedo[points, None]
    assert relative(result, transport.rows(points, False)) < 1e-6


def test_more_rank_is_never_worse(transport):
    points = np.arange(0, transport.n_points, 5)
    truth = transport.rows(points)
    albedo, errors = transport.albedo[points, None], []
    for rank in (0, 2, 10, 80):
        errors.append(relative(TransportRows(transport, rank=rank).block(points) * albedo, truth))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.2 * errors[0]


def test_a_grey_scene_needs_no_colour_differences(transport):
    from dataclasses import replace

    grey = replace(transport, materials=np.full_like(transport.albedo, 0.5))
    rows = TransportRows(grey, rank=40)
    assert len(rows.code.slices) == 2 or rows.code.n_features < 384 + 40 + 2
    assert relative(rows.block(np.arange(9)) * 0.5, grey.rows(np.arange(9))) < 2e-2


@pytest.mark.parametrize("resolution", [None, 2])
@pytest.mark.parametrize("n_channels", [1, 2, 3])
def test_code_of_arrays_can_be_undone(resolution, n_channels):
    array = RNG.standard_normal((5, 24, n_channels))
    rows = ArrayRows(array, resolution)
    features = rows.features(np.arange(5))
    np.testing.assert_allclose(rows.code.decode(features), array, atol=1e-5)
    light = RNG.standard_normal((24, n_channels))
    truth = np.einsum("ndc,dc->nc", array, light)
    result = rows.code.products(features, rows.code.light(light))
    np.testing.assert_allclose(result, truth, rtol=1e-5, atol=1e-5)


def test_wrong_rows_are_refused():
    with pytest.raises(PRTError, match="resolution"):
        ArrayRows(np.zeros((3, 23)), 2)
    with pytest.raises(PRTError, match="NaN"):
        ArrayRows(np.full((3, 24), np.nan))


@pytest.mark.parametrize("shape", [(5, 40), (40, 5), (7, 7)])
def test_principal_rows_are_singular_vectors(shape):
    matrix = RNG.standard_normal(shape).astype(np.float32)
    rows, energies = principal_rows(matrix, 3)
    _, s, vt = np.linalg.svd(matrix.astype(np.float64), full_matrices=False)
    np.testing.assert_allclose(energies, s[:3] ** 2, rtol=1e-4)
    np.testing.assert_allclose(np.abs(rows @ vt[:3].T), np.eye(3), atol=1e-3)
    np.testing.assert_allclose(rows @ rows.T, np.eye(3), atol=1e-5)


def test_rank_deficient_matrices_give_fewer_directions():
    thin = RNG.standard_normal((30, 2)).astype(np.float32)
    assert orthonormal_columns(np.hstack([thin, thin[:, :1]])).shape == (30, 2)
    assert principal_rows(thin @ RNG.standard_normal((2, 9)).astype(np.float32), 6)[0].shape[0] == 2
    assert principal_rows(np.zeros((4, 9), np.float32), 3)[0].shape == (0, 9)
