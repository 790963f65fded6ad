"""The table of one point: cells, look-ups, colours."""

import numpy as np
import pytest

from prt_core.errors import PRTError
from prt_core.lightfield import HRDFLayout, to_rgb, to_ycbcr
from prt_core.lightfield.hrdf import FROM_YCBCR
from prt_core.sphere import hemisphere_directions, hemisphere_square

SHAPES = (32, 16), (7, 5), (1, 4), (3, 1), (1, 1)


def directions(count, least=-1.0):
    rng = np.random.default_rng(3)
    vectors = rng.standard_normal((count, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors[vectors[:, 2] >= least]


@pytest.mark.parametrize("shape", SHAPES)
def test_cells_are_those_of_the_concentric_map(shape):
    layout = HRDFLayout(*shape)
    assert layout.shape == shape and layout.n_cells == len(layout.directions)
    assert np.isclose(layout.solid_angle * layout.n_cells, 2 * np.pi)
    assert (layout.nearest(layout.directions) == np.arange(layout.n_cells)).all()
    row, column = np.divmod(np.arange(layout.n_cells), shape[1])
    middles = hemisphere_directions((column + 0.5) / shape[1], (row + 0.5) / shape[0])
    assert np.allclose(layout.directions, middles)
    towards = directions(500, 0)
    u, v = hemisphere_square(towards)
    inside = np.minimum(v * shape[0], shape[0] - 1).astype(int) * shape[1]
    inside += np.minimum(u * shape[1], shape[1] - 1).astype(int)
    assert (layout.nearest(towards) == inside).all()


@pytest.mark.parametrize("shape", SHAPES)
def test_bilinear_is_exact_for_what_is_linear_in_the_square(shape):
    layout = HRDFLayout(*shape)
    towards = directions(500, 0)
    cells, weights = layout.bilinear(towards)
    assert cells.shape == weights.shape == (len(towards), 4)
    assert (cells >= 0).all() and (cells < layout.n_cells).all() and (weights >= 0).all()
    assert np.allclose(weights.sum(axis=1), 1, atol=1e-6)
    row, column = np.divmod(np.arange(layout.n_cells), shape[1])
    u, v = hemisphere_square(towards)
    # Between the outermost middles and the horizon the value of the middle holds.
    wanted_row = np.clip(v * shape[0] - 0.5, 0, shape[0] - 1)
    wanted_column = np.clip(u * shape[1] - 0.5, 0, shape[1] - 1)
    assert np.allclose((weights * row[cells]).sum(axis=1), wanted_row, atol=2e-4)
    assert np.allclose((weights * column[cells]).sum(axis=1), wanted_column, atol=2e-4)


def test_below_the_facet_is_the_horizon():
    layout = HRDFLayout(9, 7)
    below = directions(300)
    below = below[below[:, 2] < 0]
    horizon = below * [1, 1, 0]
    horizon /= np.linalg.norm(horizon, axis=1, keepdims=True)
    for got, wanted in zip(layout.places(below), layout.places(horizon), strict=True):
        assert np.allclose(got, wanted, atol=1e-4)
    straight = layout.bilinear(np.array([[0, 0, 1.0], [0, 0, -1.0]]))
    assert np.isfinite(straight[1]).all()


def test_cells_at_the_border_do_not_wrap_around():
    layout = HRDFLayout(9, 7)
    # Just above the horizon towards +x and -x: cells of the last and the first column only.
    for sign, column in ((1, 6), (-1, 0)):
        cells, weights = layout.bilinear(np.array([[sign, 0.05, 0.001]]) / np.hypot(1, 0.05))
        assert set(cells[weights > 1e-6] % 7) == {column}


def test_grey_has_no_chroma_and_light_adds_up():
    grey = to_ycbcr(np.full((2, 3), 7.5))
    assert np.allclose(grey[:, 0], 7.5) and np.allclose(grey[:, 1:], 0, atol=1e-5)
    rgb = np.random.default_rng(0).random((5, 2, 3)) * 1000
    assert np.allclose(to_rgb(to_ycbcr(rgb)), rgb, rtol=1e-5, atol=1e-3)
    assert np.allclose(to_ycbcr(rgb[:1] + 2 * rgb[1:2]), to_ycbcr(rgb[:1]) + 2 * to_ycbcr(rgb[1:2]))
    # ITU-R BT.709: blue is luma and 1.8556 Cb, red luma and 1.5748 Cr.
    assert np.allclose(FROM_YCBCR[1:, [2, 0]], [[1.8556, 0], [0, 1.5748]], atol=1e-12)


def test_wrong_tables_are_refused():
    for wrong in ((0, 4), (4, 2.5), (4, True), (2000, 4)):
        with pytest.raises(PRTError, match="rows|columns"):
            HRDFLayout(*wrong)
    with pytest.raises(PRTError, match="rgb"):
        to_ycbcr(np.zeros((4, 2)))
    with pytest.raises(PRTError, match="ycbcr: 1 values are NaN"):
        to_rgb(np.array([np.nan, 0, 0]))
