"""Single elements of a form are the columns of its product with lights of one texel."""

import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import ImageWavelet, PointHaar, PointMultiwavelet
from prt_core.compress import (
    PCA,
    ArrayRows,
    BlockPCA,
    ClusteredPCA,
    HaarLighting,
    Harmonics,
    ImageRows,
    Irradiance,
    SparseClusteredPCA,
    TransportRows,
    VectorQuantisation,
    Wavelet4D,
    method_named,
    method_names,
    neighbour_pairs,
)
from prt_core.compress import base as base_module
from prt_core.scene.images.point_images import PointImage

RNG = np.random.default_rng(11)
N_POINTS, READS = 35, [0, 1, 2, 0, 2]
PLACES = RNG.random((N_POINTS, 3))
NORMALS = np.tile([0.0, 0, 1], (N_POINTS, 1))
NEAR = np.arange(0, 2 * N_POINTS, 2)[:, None] % N_POINTS // 2 * 2
IMAGE = ImageWavelet((5, 7), "5/3")
KINDS = [
    PCA(5),
    VectorQuantisation(7),
    ClusteredPCA(4, 3),
    ClusteredPCA(4, 3, method="iterative"),
    BlockPCA((5, 7), 4, 3),
    SparseClusteredPCA(np.arange(0, N_POINTS, 2), NEAR, 3, 2),
    HaarLighting(3, step=1e-2),
    Harmonics(3),
    Wavelet4D(error=0.2),
    Wavelet4D(PointHaar(PLACES), error=0.2, mode="4d", n_terms=2),
    Wavelet4D(PointMultiwavelet(PLACES, NORMALS), "haar", error=0.1, bits=None),
    Wavelet4D(IMAGE, error=0.1, scaling="levels", bits=12, memory=1),
]
BY_FOUR = [Wavelet4D(PointMultiwavelet(PLACES, NORMALS), "d4", error=0.2, light_error=0.5)]


def named(model):
    return f"{type(model).__name__} {model.get_params()}"[:60]


def columns_of(model):
    """(n_points, n_directions, n_outputs): the product with light of each texel alone."""
    model, n_directions = model.uncut(), model.n_directions_
    lights = np.zeros((n_directions, n_directions, model.n_channels_), np.float32)
    lights[np.arange(n_directions), np.arange(n_directions)] = 1
    return np.stack([model.product(light) for light in lights], axis=1)


def faults(model, n=131):
    """What is wrong with some entries, in any order and again, beside the columns."""
    wanted = columns_of(model)
    points = RNG.integers(0, model.n_points_, n)
    columns = RNG.integers(0, model.n_directions_, n)
    points[5], columns[5] = points[3], columns[3]
    result = model.entries(points, columns)
    away = np.abs(result - wanted[points, columns]).max()
    return [
        fault
        for fault, is_there in {
            f"shape {result.shape}": result.shape != (n, model.n_outputs_),
            f"type {result.dtype}": result.dtype != np.float32,
            "nothing but zeros": not result.any(),
            f"{away} from the columns": not away <= 2e-6 * np.abs(wanted).max(),
            "no pairs have entries": model.entries([], []).shape != (0, model.n_outputs_),
        }.items()
        if is_there
    ]


def test_each_registered_method_is_here():
    # Irradiance is made of normals, not of rows: it is among the forms of a transport below.
    kinds = {type(model) for model in KINDS} | {Irradiance}
    assert all(method_named(name).kind in kinds for name in method_names())


@pytest.mark.parametrize("resolution", [2, 3])
@pytest.mark.parametrize("model", KINDS, ids=named)
def test_entries_are_the_columns_of_products(model, resolution):
    n_directions = 6 * resolution**2
    matrix = RNG.standard_normal((N_POINTS, n_directions, 5))
    model = model.fit(ArrayRows(matrix, resolution, READS))
    assert not faults(model)
    wanted = columns_of(model)
    light = RNG.random((n_directions, 3)).astype(np.float32)
    total = np.einsum("pdo,do->po", wanted, light[:, READS])
    result = model.uncut().product(light)
    np.testing.assert_allclose(result, total, atol=1e-5 * np.abs(total).max())


@pytest.mark.parametrize("model", BY_FOUR, ids=named)
def test_rows_in_longer_wavelets(model):
    assert not faults(model.fit(ArrayRows(RNG.standard_normal((N_POINTS, 96, 2)), 4)))


@pytest.mark.parametrize("model", KINDS, ids=named)
def test_rows_of_nothing_have_no_entries(model):
    model = model.fit(ArrayRows(np.zeros((N_POINTS, 24, 2)), 2))
    assert not model.entries(np.arange(24), np.arange(24)).any()


def test_directions_that_are_no_cube_map():
    assert not faults(ClusteredPCA(3, 2).fit(RNG.standard_normal((N_POINTS, 13, 2))))


@pytest.mark.parametrize("natural", [True, False])
def test_rows_of_a_transport_with_blended_borders(scene, transport, natural):
    rows, points = TransportRows(transport, 20, natural), scene.points
    model = ClusteredPCA(6, 3).fit(rows)
    pairs = neighbour_pairs(points.positions, points.normals, points.object_index)
    model.blend_borders(rows, pairs)
    assert len(model.border_points_) and len(model.code_.groups) > 1
    assert not faults(model, 311)
    every = np.arange(rows.n_points)
    column = np.full(rows.n_points, 101)
    result, wanted = model.entries(every, column), model.reconstruct(every)[:, 101]
    np.testing.assert_allclose(result, wanted, atol=1e-6 * np.abs(wanted).max())


@pytest.mark.parametrize("model", [Irradiance(), Harmonics(5), HaarLighting(9), Wavelet4D()])
def test_other_forms_of_a_transport(transport, model):
    assert not faults(model.fit(TransportRows(transport, 20)), 311)


def test_pixels_of_an_image(transport):
    """Rows of pixels have mixtures of outputs, and black ones have nothing."""
    n = 35
    image = PointImage(5, 7, 1, np.arange(1, n), np.arange(n - 1))
    rows = ImageRows(TransportRows(transport, 10), image, transport.albedo)
    for model in (PCA(4), Wavelet4D(IMAGE, error=0.1)):
        model.fit(rows)
        assert not faults(model)
        every = np.arange(transport.n_directions)
        assert np.abs(model.entries(0 * every, every)).max() < 0.1


def test_many_pairs_are_looked_up_piece_by_piece(monkeypatch):
    matrix = RNG.standard_normal((N_POINTS, 24, 2))
    points, columns = np.arange(N_POINTS), np.arange(N_POINTS) % 24
    for model in (PCA(5), HaarLighting(), Harmonics(2)):
        model = model.fit(ArrayRows(matrix, 2))
        wanted = model.entries(points, columns)
        with monkeypatch.context() as patch:
            patch.setattr(base_module, "_PAIRS", 4)
            result = model.entries(points, columns)
        np.testing.assert_allclose(result, wanted, atol=1e-6)


def test_a_form_that_was_kept_has_the_same_entries():
    matrix = RNG.standard_normal((N_POINTS, 24, 5))
    points, columns = np.arange(24), np.arange(24)[::-1]
    for model in KINDS:
        if type(model) not in (BlockPCA, SparseClusteredPCA):
            model = model.fit(ArrayRows(matrix, 2, READS))
            again = type(model).from_state(model.state())
            np.testing.assert_array_equal(
                again.entries(points, columns), model.entries(points, columns)
            )


@pytest.mark.parametrize(
    "points, columns, message",
    [
        ([0, N_POINTS], [0, 0], "points: expected values from 0 to 34, got 35"),
        ([0, -1], [0, 0], "points: expected values from 0 to 34, got -1"),
        ([0, 1], [0, 24], "columns: expected values from 0 to 23, got 24"),
        ([0, 1], [-3, 0], "columns: expected values from 0 to 23, got -3"),
        ([0, 1], [0], r"columns: expected an array of shape \(2\), got \(1,\)"),
        ([[0]], [[0]], r"points: expected an array of shape \(n\), got \(1, 1\)"),
        ([0.5], [0], "points: expected an array of whole numbers"),
        ("all", [0], "points: expected an array of numbers"),
    ],
)
def test_wrong_indices_are_said_in_one_line(points, columns, message):
    model = PCA(2).fit(RNG.standard_normal((N_POINTS, 24)))
    with pytest.raises(PRTError, match=message) as caught:
        model.entries(points, columns)
    assert "\n" not in str(caught.value)
    with pytest.raises(PRTError, match="PCA: holds nothing yet; call fit"):
        PCA(2).entries([0], [0])
