"""Every compressor of HRDFs behind the same calls."""

import numpy as np
import pytest

from prt_core import run
from prt_core.errors import PRTError
from prt_core.lightfield import CEOB, CPCA, METHODS, Haar2D, HRDFHarmonics, compressor_from_text
from prt_core.lightfield.compressor import HRDFCompressor
from prt_core.lightfield.rivals.haar import haar_basis

NAMES = list(METHODS)
# Small enough for fields of tests.
SMALL = {"ceob": {"n_pairs": 3}, "ksvd": {"n_atoms": 12}}


def luma(field):
    return field[0].sum(axis=(0, -1))


def fitted(name, hrdfs, labels=None, **goal):
    return METHODS[name](**SMALL.get(name, {}), **goal).fit(hrdfs, labels)


def squared_error(model, hrdfs):
    return np.square(model.decode(slice(None)) - hrdfs, dtype=np.float64).sum()


@pytest.mark.parametrize("name", NAMES)
def test_all_reads_agree_and_a_state_is_the_same_again(name, field):
    hrdfs = luma(field)
    labels = (np.arange(len(hrdfs)) % 3 > 0).astype(np.int32)
    model = fitted(name, hrdfs, labels, n_coefficients=5)
    decoded = model.decode(slice(None))
    assert decoded.shape == hrdfs.shape and decoded.dtype == np.float32
    rng = np.random.default_rng(0)
    points, cells = rng.integers(0, len(hrdfs), 90), rng.integers(0, 48, 90)
    flat = decoded.reshape(len(hrdfs), -1)
    scale = np.abs(flat).max()
    assert np.allclose(model.entries(points, cells), flat[points, cells], atol=2e-6 * scale)
    assert np.allclose(model.decode(points[:7]), decoded[points[:7]], atol=2e-6 * scale)
    assert model.decode(points[:0]).shape == (0, 8, 6) and not len(model.entries([], []))
    row, column = (rng.random(len(hrdfs)).astype(np.float32) * n for n in (7, 5))
    row[0], column[1] = 7, 0
    plain = HRDFCompressor.interpolated(model, row, column)
    assert np.allclose(model.interpolated(row, column), plain, atol=1e-5 * scale)
    state = model.state()
    assert model.coded_nbytes == sum(v.nbytes for v in state.values() if hasattr(v, "nbytes"))
    assert model.dictionary_nbytes <= model.coded_nbytes and model.nbytes > 0
    again = type(model).from_state(state, labels)
    assert np.array_equal(again.decode(slice(None)), decoded)
    assert again.nbytes == model.nbytes and again.get_params() == model.get_params()
    for key in state:
        with pytest.raises(PRTError):
            type(model).from_state({k: v for k, v in state.items() if k != key}, labels)
    with pytest.raises(PRTError):
        type(model).from_state(state, labels[:-1])


@pytest.mark.parametrize("name", NAMES)
def test_more_coefficients_and_lower_thresholds_are_nearer(name, field):
    hrdfs = luma(field)
    energy = np.square(hrdfs, dtype=np.float64).sum()
    models = [fitted(name, hrdfs, n_coefficients=n) for n in (2, 6, 18)]
    errors = [squared_error(model, hrdfs) / energy for model in models]
    assert errors[0] > errors[1] > errors[2]
    assert all(m.n_numbers_ <= n * len(hrdfs) for m, n in zip(models, (2, 6, 18), strict=True))
    trials = [models[1].clone().set_params(n_coefficients=None, threshold=t) for t in (0.5, 0.05)]
    trials = [trial.fit(hrdfs) for trial in trials]
    coarse, fine = (squared_error(trial, hrdfs) for trial in trials)
    assert fine < coarse and trials[0].n_numbers_ < trials[1].n_numbers_
    # With the dictionary that was learned.
    again = run(trials[1].trial_steps(hrdfs[:20], np.zeros(20, np.int32), 0.5))
    assert again.n_points_ == 20 and trials[1].threshold == 0.05
    assert squared_error(again, hrdfs[:20]) > squared_error(trials[1], hrdfs) * 20 / len(hrdfs)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_too_little(name):
    rng = np.random.default_rng(5)
    caustic = rng.random((9, 4, 6)).astype(np.float32)
    caustic[4, 1, 2] = 1e6
    for hrdfs in (
        np.zeros((4, 5, 3)),
        np.ones((3, 5, 3)),
        np.concatenate([np.zeros((2, 5, 3)), np.ones((2, 5, 3)), rng.random((1, 5, 3))]),
        rng.random((1, 2, 2)),
        rng.random((4, 1, 1)),
        caustic,
    ):
        for goal in ({"n_coefficients": 3}, {"threshold": 0.01}):
            model = fitted(name, hrdfs, **goal)
            decoded = model.decode(slice(None))
            assert np.isfinite(decoded).all()
            again = type(model).from_state(model.state(), np.zeros(len(hrdfs), np.int32))
            assert np.array_equal(again.decode(slice(None)), decoded)
            if not hrdfs.any():
                assert not decoded.any()
    # Others spread the caustic over all, or know no HRDF that they were not trained with.
    if name in ("ceob", "haar", "dct"):
        others = np.arange(9) != 4
        model = fitted(name, caustic, threshold=0.01)
        assert np.abs(model.decode(others.nonzero()[0]) - caustic[others]).max() < 0.2
        assert abs(model.decode(np.array([4]))[0, 1, 2] / 1e6 - 1) < 0.02


def test_wrong_calls_are_refused_in_one_line():
    good = np.random.default_rng(0).random((5, 4, 3)).astype(np.float32)
    bad = good.copy()
    bad[1, 2, 0] = np.nan
    for name in NAMES:
        for hrdfs, labels, message in (
            (bad, None, "hrdfs: 1 values are NaN or infinite"),
            (good[0], None, "hrdfs: expected an array of shape"),
            (good[:0], None, "hrdfs: expected at least one"),
            (good, np.zeros(4, int), "labels: expected an array of shape"),
            (good, np.full(5, 7), "labels: expected values"),
        ):
            with pytest.raises(PRTError, match=message):
                fitted(name, hrdfs, labels, n_coefficients=2)
        with pytest.raises(PRTError, match="give one of"):
            METHODS[name]().fit(good)
        with pytest.raises(PRTError, match="holds nothing yet"):
            METHODS[name](threshold=1.0).decode(slice(None))
        model = fitted(name, good, n_coefficients=2)
        with pytest.raises(PRTError, match="cells: expected values"):
            model.entries([0], [12])
        with pytest.raises(PRTError, match="points: expected values"):
            model.decode(np.array([5]))
    for text, message in (
        ("wavelets", "method: expected one of"),
        ("ceob:pairs=3", "method: 'ceob' has the settings"),
        ("ceob:threshold=3", "method: 'ceob' has the settings"),
        ("haar:bits=3", "method: 'haar' has the settings"),
    ):
        with pytest.raises(PRTError, match=message):
            compressor_from_text(text, threshold=1.0)
    with pytest.raises(PRTError, match="bits: expected a whole number from 6 to 16"):
        compressor_from_text("ceob:bits=5", threshold=1.0).expect_params()


def test_one_threshold_beats_an_error_for_each_hrdf(field):
    hrdfs = luma(field)
    each = CEOB(error=0.3, n_pairs=3).fit(hrdfs)
    rest = np.sqrt(np.square(each.decode(slice(None)) - hrdfs).sum(axis=(1, 2)))
    # Rounding adds a little to what is allowed.
    assert rest.max() < 0.3 * 1.1
    model, low, high = each.clone().set_params(error=None, threshold=1.0), 1e-3, 1.0
    model.fit(hrdfs)
    for _ in range(20):
        middle = np.sqrt(low * high)
        trial = run(model.trial_steps(hrdfs, np.zeros(len(hrdfs), np.int32), middle))
        fine = squared_error(trial, hrdfs) <= squared_error(each, hrdfs)
        low, high = (middle, high) if fine else (low, middle)
    trial = run(model.trial_steps(hrdfs, np.zeros(len(hrdfs), np.int32), low))
    assert trial.coded_nbytes < each.coded_nbytes


def test_principal_components_are_those_of_the_svd(field):
    hrdfs = luma(field)
    flat = hrdfs.reshape(len(hrdfs), -1).astype(np.float64)
    values = np.linalg.svd(flat - flat.mean(axis=0))[1]
    model = CPCA(n_coefficients=4, bits=16).fit(hrdfs)
    wanted = np.square(values[4:]).sum()
    assert np.isclose(squared_error(model, hrdfs), wanted, rtol=0.03)
    # Fewer HRDFs than cells, and than components.
    few = CPCA(n_coefficients=4, bits=16).fit(hrdfs[:3])
    assert squared_error(few, hrdfs[:3]) < 1e-6 * np.square(hrdfs[:3]).sum()


def test_harmonics_are_least_squares(field):
    from prt_core.basis import harmonics
    from prt_core.lightfield import HRDFLayout

    hrdfs = luma(field)
    flat = hrdfs.reshape(len(hrdfs), -1).astype(np.float64)
    values = harmonics(HRDFLayout(*hrdfs.shape[1:]).directions, 3)
    solved = values @ np.linalg.lstsq(values, flat.T, rcond=None)[0]
    wanted = np.square(solved.T - flat).sum()
    model = HRDFHarmonics(n_coefficients=9).fit(hrdfs)
    assert np.isclose(squared_error(model, hrdfs), wanted, rtol=0.03)


@pytest.mark.parametrize("size", [1, 2, 6, 7, 16])
def test_haar_wavelets_are_orthonormal_and_coarse_to_fine(size):
    basis = haar_basis(size)
    assert np.allclose(basis.T @ basis, np.eye(size), atol=1e-12)
    reach = (basis != 0).sum(axis=0)
    assert (np.diff(reach) <= 0).all()
    even = np.ones((2, size, size))
    assert squared_error(Haar2D(n_coefficients=(size & size ^ size - 1) ** 2).fit(even), even) >= 0
