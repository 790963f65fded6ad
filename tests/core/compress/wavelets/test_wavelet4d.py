import numpy as np
import pytest

from prt_core import PRTError
from prt_core.basis import ImageWavelet, PointHaar, PointMultiwavelet
from prt_core.compress import ArrayRows, TransportRows, Wavelet4D
from prt_core.compress.wavelets.column_coder import ColumnCoder
from prt_core.compress.wavelets.column_depth import (
    invert_from,
    transform_to_best,
    transform_to_better,
)
from prt_core.compress.wavelets.columns import transposed_steps
from prt_core.compress.wavelets.limit_search import LimitSearch
from prt_core.compress.wavelets.quantise import dequantise, quantise
from prt_core.compress.wavelets.sparse_columns import SparseColumns, column_bytes
from prt_core.runtime.progress import run
from tests.core.compress.conftest import relative

RNG = np.random.default_rng(3)


@pytest.fixture(scope="module")
def rows(transport):
    return TransportRows(transport, 80)


@pytest.fixture(scope="module")
def matrix(rows):
    return rows.block(np.arange(rows.n_points))


@pytest.fixture(scope="module")
def grey(matrix):
    return ArrayRows(matrix[..., 0], 8)


@pytest.fixture(scope="module")
def hierarchy(scene):
    points = scene.points
    return PointMultiwavelet(points.positions, points.normals, points.object_index)


def restored(model):
    """The matrix that a model holds, column by column; no light is cut."""
    model = model.uncut()
    lights = np.eye(model.n_directions_, dtype=np.float32)
    white = np.ones((1, model.n_channels_), np.float32)
    return np.stack([model.product(light[:, None] * white) for light in lights], axis=1)


@pytest.mark.parametrize("wavelet", ["haar", "d4", "d6", "d8"])
@pytest.mark.parametrize("mode", ["adaptive", "4d", "2d"])
def test_every_term_is_exact_even_under_a_sun(rows, matrix, hierarchy, light, mode, wavelet):
    model = Wavelet4D(hierarchy, wavelet, error=0, mode=mode, bits=None).fit(rows)
    truth = np.einsum("pdc,dc->pc", matrix.astype(np.float64), light)
    assert relative(model.product(light), truth) < 1e-5
    assert model.matrix_error_ < 1e-6


@pytest.mark.parametrize("bits", [9, None])
def test_the_error_asked_for_is_met_and_adaptive_is_never_the_largest(
    rows, matrix, hierarchy, bits
):
    for error in (0.1, 0.02):
        sizes = {}
        for mode in ("adaptive", "4d", "2d"):
            model = Wavelet4D(hierarchy, error=error, mode=mode, bits=bits).fit(rows)
            assert 0.97 * error < model.matrix_error_ <= error
            sizes[mode] = model.nbytes
        assert sizes["adaptive"] <= min(sizes["4d"], sizes["2d"])
    adaptive = Wavelet4D(hierarchy, error=error, bits=bits).fit(rows)
    assert relative(restored(adaptive), matrix) == pytest.approx(adaptive.matrix_error_, rel=1e-3)


@pytest.mark.parametrize("wavelet", ["haar", "d4", "d6", "d8", "5/3", "9/7"])
def test_the_error_of_images_is_the_true_one(wavelet):
    v, u, d = np.mgrid[0:16, 0:16, 0:24] / 16
    matrix = np.maximum(np.sin(3 * u + v * d) + (u > d / 2), 0.1).reshape(256, 24)
    rows = ArrayRows(matrix.astype(np.float32), 2)
    model = Wavelet4D(ImageWavelet((16, 16), wavelet), error=0.03).fit(rows)
    assert 0.025 < model.matrix_error_ <= 0.03
    result = restored(model)[..., 0]
    assert relative(result, matrix) == pytest.approx(model.matrix_error_, rel=1e-3)
    assert model.depths_.max() > 0


def test_rate_and_distortion_are_monotone(grey, hierarchy):
    models = [Wavelet4D(hierarchy, error=e).fit(grey) for e in (0.2, 0.06, 0.02)]
    sizes = [m.nbytes for m in models]
    assert sizes == sorted(sizes) and sizes[0] < 0.7 * sizes[-1]


def test_a_budget_is_kept_and_used(grey, hierarchy):
    small = Wavelet4D(hierarchy, nbytes_wanted=20_000).fit(grey)
    large = Wavelet4D(hierarchy, nbytes_wanted=40_000).fit(grey)
    extra = 2 * grey.n_points + hierarchy.features.nbytes + 8 + small.importance_.nbytes
    for model, budget in ((small, 20_000), (large, 40_000)):
        assert 0.95 * budget < model.nbytes - extra <= budget
    assert large.matrix_error_ < 0.9 * small.matrix_error_
    with pytest.raises(PRTError, match="too little"):
        Wavelet4D(hierarchy, nbytes_wanted=10).fit(grey)


@pytest.mark.parametrize("scaling", ["levels", "none"])
def test_other_scalings_keep_the_error_too(grey, hierarchy, scaling):
    model = Wavelet4D(hierarchy, error=0.05, scaling=scaling, dither=True).fit(grey)
    result = relative(restored(model)[..., 0], grey.array[..., 0])
    assert result == pytest.approx(model.matrix_error_, rel=1e-3) and result <= 0.0501


def test_too_few_bits_are_said(grey, hierarchy):
    with pytest.raises(PRTError, match="3 bits"):
        Wavelet4D(hierarchy, error=0.001, bits=3).fit(grey)
    # Within reach only of all there is, and of what quantising leaves of it: four times the bytes.
    rng = np.random.default_rng(3)
    heavy = np.exp(rng.normal(0, 2, (64, 96, 1))).astype(np.float32)
    heavy[:, :8] *= 300
    columns = PointHaar(rng.random((64, 3)))
    assert Wavelet4D(columns, error=0.05, bits=4).fit(ArrayRows(heavy, 4)).n_coefficients_ < 1000
    with pytest.raises(PRTError, match="4 bits"):
        Wavelet4D(columns, error=0.045, bits=4).fit(ArrayRows(heavy, 4))
    # What has no small terms is not refused, though nothing is cut.
    spikes = np.zeros((64, 96, 1), np.float32)
    spikes[np.arange(64), rng.permutation(96)[:64]] = rng.uniform(1, 2, (64, 1))
    assert Wavelet4D(columns, error=0.01, bits=9).fit(ArrayRows(spikes, 4)).matrix_error_ <= 0.01


def test_nine_bits_add_little_and_save_much(grey, hierarchy):
    floats = Wavelet4D(hierarchy, error=0.03, bits=None).fit(grey)
    nine = Wavelet4D(hierarchy, error=0.03, bits=9).fit(grey)
    assert nine.n_coefficients_ < 1.1 * floats.n_coefficients_
    assert nine.nbytes < 0.65 * floats.nbytes


@pytest.mark.parametrize("wavelet", [None, "9/7"])
def test_what_quantising_leaves_of_a_large_term_is_kept_too(wavelet):
    transform = ImageWavelet((16, 16), wavelet) if wavelet else PointHaar(RNG.random((256, 3)))
    column = RNG.uniform(-30, 30, 256).astype(np.float32)
    column[:20] *= 1e3
    coder = ColumnCoder(transform, 0, 0, 9, "root", False, 1 << 29, 0)
    (result,) = coder.encode([0], column[None].copy(), 1.0)
    assert result.lost <= (column * column > 1).sum() * 1.01 + (column[column**2 <= 1] ** 2).sum()
    assert len(result.places) > len(np.unique(result.places)) == (column * column > 1).sum()
    said = np.zeros(256, np.float32)
    np.add.at(said, result.places, dequantise(result.values, None, result.size, "root"))
    assert ((said - column) ** 2).sum() == pytest.approx(result.lost, rel=1e-3)


@pytest.mark.parametrize("wavelet", [None, "5/3"])
def test_rows_of_zeros_of_ones_and_with_one_entry(wavelet):
    matrix = np.zeros((64, 96, 1), np.float32)
    matrix[3], matrix[5, 17], matrix[40:] = 1, 1e3, RNG.random((24, 96, 1))
    columns = ImageWavelet((8, 8), wavelet) if wavelet else PointHaar(RNG.random((64, 3)))
    model = Wavelet4D(columns, error=0.01, bits=12).fit(ArrayRows(matrix, 4))
    assert relative(restored(model), matrix) <= 0.0101
    nothing = Wavelet4D(columns).fit(ArrayRows(0 * matrix, 4))
    assert nothing.n_coefficients_ == 0 and not nothing.product(np.ones((96, 1))).any()
    assert nothing.matrix_error_ == 0


def test_float64_rows_give_what_float32_rows_give(grey, hierarchy, light):
    one = Wavelet4D(hierarchy, error=0.02).fit(grey)
    two = Wavelet4D(hierarchy, error=0.02).fit(ArrayRows(grey.array.astype(np.float64), 8))
    # A value at the edge of a step falls to either side, as machines round.
    assert relative(one.product(light[:, 0]), two.product(light[:, 0])) < 1e-3


def test_fewer_wavelets_of_the_light_come_nearer_with_more(rows, hierarchy, light):
    model = Wavelet4D(hierarchy, error=0.02, light_error=0.0, n_terms=384).fit(rows)
    every = model.product(np.minimum(light, 3))
    errors = []
    for n_terms in (10, 60, 200):
        model.n_terms = n_terms
        errors.append(relative(model.product(np.minimum(light, 3)), every))
    assert errors == sorted(errors, reverse=True) and 0 < errors[-1] < 0.2 * errors[0]


def test_a_light_is_cut_to_what_its_colours_need(rows, hierarchy, light):
    model = Wavelet4D(hierarchy, error=0.02, light_error=0.0).fit(rows)
    light = np.minimum(light, 3)
    every, used = model.product(light), []
    for share in (1e-3, 1e-2, 1e-1):
        model.light_error = share
        used.append(int(model.choose(light).any(axis=1).sum()))
        assert 0 < relative(model.product(light), every) < 2 * share
    assert 0 < used[2] < used[1] < used[0] <= rows.n_directions
    model.light_error = None
    assert 0 < relative(model.product(light), every) < 2 * model.matrix_error_ / 10
    # A share of nothing, and of light that no point sees.
    assert not model.product(0 * light).any()
    with pytest.raises(PRTError, match="light_error"):
        Wavelet4D(hierarchy, light_error=1.0).fit(rows)


@pytest.mark.parametrize("columns", ["points", "haar", "image"])
def test_its_state_makes_it_again(rows, hierarchy, matrix, light, columns):
    if columns != "image":
        transform = hierarchy if columns == "points" else PointHaar.from_order(hierarchy.order)
        model = Wavelet4D(transform, error=0.05).fit(rows)
    else:
        subset = np.ascontiguousarray(matrix[:64])
        model = Wavelet4D(ImageWavelet((8, 8), "5/3"), error=0.05, bits=None)
        model.fit(ArrayRows(subset, 8))
    state = model.state()
    again = Wavelet4D.from_state(state)
    np.testing.assert_array_equal(again.product(light), model.product(light))
    assert again.nbytes == model.nbytes
    for name, broken in (
        ("low", state["low"][:-3]),
        ("high", state["high"] | 1),
        ("counts", state["counts"] * 1000),
        ("importance", state["importance"][1:]),
    ):
        with pytest.raises(PRTError):
            Wavelet4D.from_state({**state, name: broken})
    if columns == "points":
        assert state["order"].dtype == np.uint16 and state["features"].dtype == np.int8
        # Both transforms are in use.
        assert state["groups"][:, 0].min() < 0 < state["groups"][:, 0].max()
        for deep in (20, -20):
            heads = state["groups"].copy()
            heads[:, 0] = deep
            with pytest.raises(PRTError, match="deep"):
                Wavelet4D.from_state({**state, "groups": heads})
        with pytest.raises(PRTError, match="by depth"):
            Wavelet4D.from_state({**state, "groups": state["groups"] * np.int32([-1, 1, 1])})
        with pytest.raises(PRTError, match="basis"):
            Wavelet4D.from_state({**state, "features": state["features"][::-1].copy()})


def test_light_needs_fewer_bytes_where_the_basis_knows_the_normals(rows, hierarchy):
    haar = PointHaar.from_order(hierarchy.order)
    sizes = [Wavelet4D(columns, error=0.05).fit(rows).nbytes for columns in (hierarchy, haar)]
    assert sizes[0] < 0.95 * sizes[1]


def test_the_same_seed_gives_the_same_bytes(grey, hierarchy):
    one, two, other = (
        Wavelet4D(hierarchy, error=0.05, dither=True, seed=seed).fit(grey).state()
        for seed in (4, 4, 5)
    )
    assert all(np.array_equal(one[k], two[k]) for k in ("names", "low", "high", "sizes"))
    assert not np.array_equal(one["low"], other["low"])


def test_wrong_settings_are_refused(rows, hierarchy):
    for settings, message in (
        ({"mode": "5d"}, "mode"),
        ({"rows": "5/3"}, "rows"),
        ({"error": 1.0}, "error"),
        ({"bits": 1}, "bits"),
        ({"nbytes_wanted": 0.5}, "nbytes_wanted"),
    ):
        with pytest.raises(PRTError, match=message):
            Wavelet4D(hierarchy, **settings).fit(rows)
    with pytest.raises(PRTError, match="points"):
        Wavelet4D(ImageWavelet((4, 4))).fit(rows)
    with pytest.raises(PRTError, match="texels"):
        Wavelet4D(hierarchy).fit(ArrayRows(np.zeros((rows.n_points, 10))))


@pytest.mark.parametrize("memory", [1, 1 << 14, 1 << 30])
def test_columns_come_back_from_the_file(memory):
    matrix = RNG.standard_normal((37, 11, 1)).astype(np.float32)
    order = RNG.permutation(37)
    steps = transposed_steps(lambda points: matrix[points, :, 0], 11, order, memory)
    with run(steps) as file:
        names = np.array([1, 2, 5, 10])
        np.testing.assert_array_equal(file.read(names), matrix[order][:, names, 0].T)
        np.testing.assert_allclose(file.energies, (matrix**2).sum(axis=(0, 2)), rtol=1e-6)


@pytest.mark.parametrize("transform", [ImageWavelet((8, 8), "9/7"), PointHaar(RNG.random((53, 3)))])
def test_each_column_stops_at_its_best_depth(transform):
    smooth, spike = np.ones(transform.n), np.eye(transform.n)[5]
    columns = np.stack([smooth, spike, smooth + 5 * spike]).astype(np.float32)
    coefficients = columns.copy()
    depths, _ = transform_to_best(transform, coefficients, 1e-3)
    assert depths[0] == transform.depth and depths[1] == 0 < depths[2]
    # By trying all of them one after another.
    for column, depth in zip(columns, depths, strict=True):
        costs = []
        for d in range(transform.depth + 1):
            work = column[None].copy()
            for level in range(d):
                transform.forward_step(work, level)
            weight = 1 if transform.orthonormal else transform.weights(d)
            costs.append(np.minimum(work**2 * weight, 1e-3).sum())
        assert depth == np.argmax(costs <= min(costs) * (1 + 1e-5))
    np.testing.assert_allclose(invert_from(transform, coefficients, depths), columns, atol=1e-5)


def test_each_column_takes_the_transform_that_is_better_for_it(scene, light):
    points = scene.points
    transform = PointMultiwavelet(points.positions, points.normals)
    normals, n = points.normals[transform.order], transform.n
    lit = np.maximum(0.8 + 0.3 * normals @ RNG.standard_normal((3, 4)), 0).T
    steps = np.sign(RNG.standard_normal((4, -(-n // 8)))).repeat(8, axis=1)[:, :n]
    columns = np.concatenate([lit, steps]).astype(np.float32)
    result = columns.copy()
    depths = transform_to_better(transform, transform.haar, result, 1e-3)
    assert (depths[:4] > 0).all() and (depths[4:] < 0).all()
    for one, depth, column in zip(result, depths, columns, strict=True):
        kind = transform if depth > 0 else transform.haar
        back = invert_from(kind, one[None].copy(), np.abs(depth)[None])
        np.testing.assert_allclose(back[0], column, atol=1e-5)


@pytest.mark.parametrize("n_rows", [1, 300, 70_001])
@pytest.mark.parametrize("bits", [2, 9, 13, 16, None])
def test_packed_columns_are_what_was_packed(n_rows, bits):
    counts = [min(n, 2 * n_rows) for n in (1, 4, 7, 299)]
    # A place may come twice.
    places = [np.sort(RNG.permutation(2 * n_rows)[:n] // 2).astype(np.int32) for n in counts]
    most = 1 if bits is None else (1 << (bits - 1)) - 1
    values = [RNG.integers(-most, most + 1, n).astype(np.int16) for n in counts]
    nbytes, words = column_bytes(counts, n_rows, bits)
    for word in np.unique(words):
        mine = np.flatnonzero(words == word)
        packed = SparseColumns.pack(
            n_rows, int(word), bits, mine, np.ones(len(mine)),
            [places[i] for i in mine], [values[i].astype(np.float32) for i in mine],
        )  # fmt: skip
        assert packed.nbytes == nbytes[mine].sum()
        for subset in (np.arange(len(mine)), np.arange(len(mine))[1::2]):
            result = packed.matrix(subset).toarray()
            wanted = np.zeros((n_rows, len(subset)), np.float32)
            for k, i in enumerate(mine[subset]):
                np.add.at(wanted[:, k], places[i], values[i])
            np.testing.assert_array_equal(result, wanted)


def test_quantised_values_are_within_a_step_and_dithered_ones_right_on_average():
    values, scales = RNG.standard_normal(999).astype(np.float32), RNG.integers(0, 6, 999)
    for bits in (2, 9, 16):
        most = 2 ** (bits - 1) - 1
        for scaling, scale in (("levels", 2.0**scales), ("none", 1.0)):
            integers, size = quantise(values, scales, bits, scaling, None)
            error = np.abs(dequantise(integers, scales, size, scaling) - values) * scale
            assert error.max() <= 0.5001 * size and np.abs(integers).max() == most
        integers, size = quantise(values, scales, bits, "root", None)
        error = np.abs(
            np.sqrt(
                np.abs(dequantise(integers, scales, size, "root"))
                * np.sign(integers)
                * np.sign(values)
            )
            - np.sqrt(np.abs(values))
        )
        assert error.max() <= 0.51 * np.sqrt(size) and np.abs(integers).max() == most
    same = np.full(20_000, 0.3, np.float32)
    same[0] = 1
    integers, size = quantise(same, None, 4, "none", np.random.default_rng(0))
    assert dequantise(integers, None, size, "none")[1:].mean() == pytest.approx(0.3, abs=2e-3)


@pytest.mark.parametrize("power", [0.2, 0.5, 1.5])
@pytest.mark.parametrize("rising", [True, False])
def test_limits_are_found_from_far_away(power, rising):
    def measure(limit):
        return limit ** (power if rising else -power)

    search = LimitSearch(1e-9, 40.0, rising, most=20)
    while search.limit is not None:
        search.tell(measure(search.limit))
    assert 0.98 * 40 <= search.best <= 40
