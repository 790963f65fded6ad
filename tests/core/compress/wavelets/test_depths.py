"""The depth of each column against trying all of them: a step may cost and those after it pay."""

import numpy as np
import pytest

from prt_core.basis import ImageWavelet, PointHaar, PointMultiwavelet
from prt_core.compress.wavelets.column_depth import (
    invert_from,
    transform_to_best,
    transform_to_better,
)

LIMIT = 1e-2
LINE = np.arange(40)[:, None] * np.eye(1, 3)


def costs_of(transform, column, limit):
    """error + limit x terms after each number of steps, coefficient by coefficient."""
    result, work = [], column[None].astype(np.float64)
    for depth in range(transform.depth + 1):
        if depth:
            transform.forward_step(work, depth - 1)
        squares = work[0] ** 2 * transform.weights(depth)
        result.append(sum(limit if square > limit else square for square in squares))
    return np.array(result)


def test_a_step_that_costs_is_taken_where_those_after_it_pay():
    # Where every second place is one the first step doubles the terms and no other undoes that;
    # where all are one each step halves them.
    transform = PointHaar(LINE)
    column = np.ones(40, np.float32)
    column[1:24:2] = 0
    costs = costs_of(transform, column, LIMIT)
    assert costs[1] > 1.1 * costs[0] and costs[-1] < 0.6 * costs[0]
    depths, cost = transform_to_best(transform, column[None].copy(), LIMIT)
    assert depths[0] == costs.argmin() and cost[0] == pytest.approx(costs.min())


@pytest.mark.parametrize(
    "transform",
    [
        PointHaar(LINE),
        PointMultiwavelet(LINE, np.random.default_rng(0).standard_normal((40, 3))),
        ImageWavelet((8, 16), "haar"),
        ImageWavelet((8, 16), "d4"),
        ImageWavelet((8, 16), "5/3"),
        ImageWavelet((8, 16), "9/7"),
    ],
    ids=lambda t: f"{type(t).__name__} {getattr(t, 'wavelet', '')}",
)
def test_no_depth_has_a_smaller_cost(transform):
    rng = np.random.default_rng(1)
    # Alike in patches, different in others, at all scales.
    columns = np.ones((60, transform.n))
    for column in columns:
        for size in (1, 2, 4, 8, 16):
            parts = rng.standard_normal(-(-transform.n // size)) * (rng.random() < 0.4)
            column += np.repeat(parts, size)[: transform.n] * (
                rng.random(transform.n) < rng.random()
            )
    columns = columns.astype(np.float32)
    allowed = {"least": 0, "most": transform.depth}, {"least": 1, "most": transform.depth - 1}
    beyond = 0
    for limits in allowed:
        result = columns.copy()
        depths, costs = transform_to_best(transform, result, LIMIT, **limits)
        for column, depth, cost in zip(columns, depths, costs, strict=True):
            wanted = costs_of(transform, column, LIMIT)
            subset = wanted[limits["least"] : limits["most"] + 1]
            assert limits["least"] <= depth <= limits["most"]
            assert cost == pytest.approx(subset.min(), rel=1e-3)
            assert wanted[depth] == pytest.approx(subset.min(), rel=1e-3)
            falls = np.append(np.diff(subset) < 0, False)
            beyond += subset[falls.argmin()] > 1.01 * subset.min()
        np.testing.assert_allclose(invert_from(transform, result, depths), columns, atol=1e-4)
    # Of some the best depth is beyond a step that costs.
    assert beyond or not transform.orthonormal


def test_the_better_of_two_transforms_is_the_one_that_costs_less():
    rng = np.random.default_rng(2)
    transform = PointMultiwavelet(LINE)
    columns = np.stack([LINE[:, 0] / 9, np.sign(rng.standard_normal(40)), np.repeat([0, 1], 20)])
    columns = np.concatenate([columns, rng.standard_normal((9, 40))]).astype(np.float32)
    depths = transform_to_better(transform, transform.haar, columns.copy(), LIMIT)
    for column, depth in zip(columns, depths, strict=True):
        one, other = (costs_of(kind, column, LIMIT) for kind in (transform, transform.haar))
        taken = other[-depth] if depth < 0 else one[depth]
        assert taken == pytest.approx(min(one.min(), other.min()), rel=1e-3)
    assert depths[0] > 0 > depths[2]
