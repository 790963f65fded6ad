"""Which terms of a column are kept, what they take, and which wavelets count most."""

import numpy as np
import pytest

from prt_core.basis import ImageWavelet, PointHaar, haar_areas, haar_rows
from prt_core.compress import ArrayRows, HaarLighting, Wavelet4D
from prt_core.compress.wavelets.column_coder import ColumnCoder
from prt_core.compress.wavelets.sparse_columns import column_bytes


@pytest.mark.parametrize("wavelet", ["haar", "5/3", "9/7"])
def test_terms_are_kept_by_the_energy_they_stand_for(wavelet):
    rng = np.random.default_rng(0)
    transform = ImageWavelet((16, 32), wavelet)
    columns = np.cumsum(rng.standard_normal((3, 512)), axis=1).astype(np.float32)
    coder = ColumnCoder(transform, 2, 2, None, "root", False, 1 << 29, 0)
    limit = 4.0
    result = coder.encode([5, 6, 7], columns.copy(), limit)
    for column, one in zip(columns, result, strict=True):
        coefficients = transform.forward(column[None], 2)[0]
        energies = coefficients**2 * transform.weights(2)
        sure = np.abs(energies / limit - 1) > 1e-3
        kept = np.isin(np.arange(512), one.places)
        np.testing.assert_array_equal(kept[sure], (energies > limit)[sure])
        np.testing.assert_allclose(one.values, coefficients[one.places], rtol=1e-4, atol=1e-4)
        # What is lost is measured on the picture.
        left = coefficients.copy()
        left[one.places] = 0
        picture = transform.inverse(left[None], 2)
        assert one.lost == pytest.approx((picture.astype(np.float64) ** 2).sum(), rel=1e-3)
        assert 10 < len(one.places) < 400


@pytest.mark.parametrize("bits", [5, 9, 13, None])
@pytest.mark.parametrize("n_rows", [60, 3000, 90_000])
def test_a_column_takes_the_words_that_are_shortest_for_it(bits, n_rows):
    counts = np.array([0, 1, 2, 9, 40, 41, n_rows // 3])
    nbytes, words = column_bytes(counts, n_rows, bits)
    for count, size, word in zip(counts, nbytes, words, strict=True):
        if not count:
            assert size == 0
            continue
        sizes = {}
        for subset in (12, 16, 24):
            low = subset - (bits or 0)
            if low <= 0:
                continue
            # Name, count and size; a bit for each term and for each bucket; words in pairs.
            high = -(-(count + (n_rows - 1) // 2**low + 1) // 8)
            pairs = -(-count // 2) * 2 * subset // 8
            sizes[subset] = 12 + high + pairs + (4 * count if bits is None else 0)
        assert size == min(sizes.values()) == sizes[word]


def test_wavelets_are_weighed_by_the_size_of_their_columns_or_their_area():
    rng = np.random.default_rng(1)
    matrix = rng.standard_normal((40, 96, 3)) * rng.exponential(1, (1, 96, 1)) ** 2
    model = HaarLighting(n_terms=9, step=1e-5).fit(ArrayRows(matrix, 4))
    # Luminance and two differences, transformed, column by column.
    mixed = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])
    coded = haar_rows(np.einsum("ndc,gc->gnd", matrix, mixed), 4)
    sizes = np.sqrt((coded**2).sum(axis=(0, 1)))
    np.testing.assert_allclose(model.importance_, sizes, rtol=1e-2)
    light = rng.standard_normal((96, 3)) ** 3
    coefficients = haar_rows(light.T, 4).T
    squares = (coefficients**2).sum(axis=1)
    _, areas = haar_areas(4)
    for selection, weight in (
        ("transport", squares * sizes**2),
        ("area", squares * areas),
        ("unweighted", squares),
    ):
        chosen, _ = model.terms(light, 9, selection)
        wanted = np.sort(np.argsort(weight)[-9:])
        assert len(set(chosen) & set(wanted)) >= 8
        assert weight[chosen].sum() > 0.99 * weight[wanted].sum()


def test_levels_of_points_are_those_of_the_quantiser():
    # Multiplied by 2^level before they are quantised: finer levels get finer steps.
    transform = PointHaar(np.random.default_rng(2).random((64, 3)))
    coder = ColumnCoder(transform, 6, 6, 8, "levels", False, 1 << 29, 0)
    column = np.random.default_rng(3).standard_normal((1, 64)).astype(np.float32)
    (result,) = coder.encode([0], column.copy(), 1e-9)
    coefficients = transform.forward(column[:, np.argsort(transform.order)], 6)[0]
    levels = transform.scales(6)
    largest = np.abs(np.ldexp(coefficients, levels)).max()
    assert result.size == pytest.approx(largest / 127, rel=1e-4)


def test_a_light_is_cut_to_the_wavelets_that_weigh_most_in_its_colours():
    rng = np.random.default_rng(4)
    matrix = rng.standard_normal((50, 96, 3)) * rng.exponential(1, (1, 96, 1)) ** 2
    model = Wavelet4D(PointHaar(rng.random((50, 3))), error=0.01).fit(ArrayRows(matrix, 4))
    # All channels of a wavelet together; the largest is one.
    sizes = np.sqrt((haar_rows(np.moveaxis(matrix, 2, 1), 4) ** 2).sum(axis=(0, 1)))
    np.testing.assert_allclose(model.importance_, sizes / sizes.max(), rtol=2e-3, atol=1e-3)
    light = rng.standard_normal((96, 3)) ** 3
    coefficients = haar_rows(light.T, 4).T
    weight = (coefficients**2).sum(axis=1) * sizes**2
    for n_terms, share in ((7, 0.0), (30, 0.0), (None, 0.2), (None, 0.05)):
        model.n_terms, model.light_error = n_terms, share
        kept = model.choose(light)
        order = np.argsort(weight)
        spare = (np.cumsum(weight[order]) < share**2 * weight.sum()).sum()
        wanted = order[spare:][-(n_terms or 96) :]
        chosen = np.flatnonzero(kept.any(axis=1))
        # Importances are kept in 16 bits.
        assert abs(len(chosen) - len(wanted)) <= 1
        assert len(set(chosen) & set(wanted)) >= len(wanted) - 1
        np.testing.assert_allclose(kept[chosen], coefficients[chosen], rtol=1e-4, atol=1e-5)
