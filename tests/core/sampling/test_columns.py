import numpy as np
import pytest

from prt_core.sampling.columns import best_columns, feature_weights
from prt_core.sampling.rivals import COLUMN_CHOICES, hasan_columns, wang_columns


def test_the_weight_is_variance_times_count():
    rng = np.random.default_rng(0)
    rows = rng.random((7, 11)).astype(np.float32)
    features = (rng.random((7, 11)) < 0.5).astype(np.float32)
    neighbours = np.array([[0, 3, 5], [2, 6, -1], [4, -1, -1]])
    result = feature_weights(rows, features, neighbours)
    for point, of in enumerate(neighbours):
        of = of[of >= 0]
        wanted = rows[of].var(axis=0) * (features[of].mean(axis=0) + 1e-3)
        np.testing.assert_allclose(result[point], wanted, rtol=1e-3, atol=1e-7)
    assert not result[2].any()


def test_what_all_neighbours_see_alike_tells_nothing():
    rows = np.full((5, 6), 0.3, np.float32)
    rows[2, 4] = 0.1
    result = feature_weights(rows, np.ones_like(rows), np.array([[0, 1, 2, 3, 4]]))
    np.testing.assert_array_equal(result > 0, [[False, False, False, False, True, False]])


def test_only_allowed_directions_are_chosen_best_first():
    weights = np.array([[5, 4, 3, 2, 0, 1]], np.float32)
    allowed = np.array([[False, True, True, True, True, True]])
    columns, valid = best_columns(weights, allowed, 2)
    np.testing.assert_array_equal(columns[valid], [1, 2])
    columns, valid = best_columns(weights, allowed, 99)
    np.testing.assert_array_equal(np.sort(columns[valid]), [1, 2, 3, 5])


@pytest.mark.parametrize("choice", COLUMN_CHOICES.values())
def test_rivals_take_one_column_of_each_kind(choice):
    rng = np.random.default_rng(2)
    kinds = np.eye(5, 9)[:, :5]
    columns = np.repeat(kinds, [3, 5, 7, 2, 11], axis=1) * (1 + 0.01 * rng.random(28))
    rows = np.concatenate([columns, np.zeros((5, 4))], axis=1).astype(np.float32)
    chosen = choice(rows, 5, np.random.default_rng(0))
    assert len(chosen) == 5
    assert chosen.max() < 28
    assert len(np.unique(np.repeat(np.arange(5), [3, 5, 7, 2, 11])[chosen])) == 5
    # Never more than there are, never twice the same.
    everything = choice(rows, 99, np.random.default_rng(0))
    assert len(np.unique(everything)) == len(everything) <= 28


def test_hasan_puts_columns_together_that_differ_in_size_alone():
    rows = np.array([[1, 2, 9, 0, 0, 0], [0, 0, 0, 1, 1, 8]], np.float32)
    for seed in range(5):
        chosen = hasan_columns(rows, 2, np.random.default_rng(seed))
        assert (chosen < 3).sum() == 1
    # The one of size 9 stands for its cluster nine times as often as that of size 1.
    drawn = [hasan_columns(rows, 2, np.random.default_rng(s))[0] for s in range(200)]
    assert np.mean(np.array(drawn) == 2) == pytest.approx(9 / 12, abs=4 * np.sqrt(0.19 / 200))


def test_wang_does_not():
    rows = np.array([[1, 1, 9, 9, 0, 0], [0, 0, 0, 0, 8, 8]], np.float32)
    chosen = wang_columns(rows, 3, np.random.default_rng(0))
    np.testing.assert_array_equal(chosen // 2, [0, 1, 2])
