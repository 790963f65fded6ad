"""Which terms and texels of a light real-time relighting keeps, against the sums they stand for."""

import numpy as np
import pytest

from prt_core.compress import ArrayRows, ClusteredPCA, ClusterEvaluator, TransportRows
from prt_core.compress.light_terms import heaviest


@pytest.mark.parametrize("n_channels", [1, 2])
def test_terms_are_left_out_by_what_they_add_to_the_colours(n_channels):
    # A term adds its coefficient times its column of the matrix that the clusters hold.
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((70, 24, n_channels)) * rng.exponential(1, (1, 24, 1)) ** 2
    matrix[:35] += 3 * rng.standard_normal((24, n_channels))
    rows = ArrayRows(matrix)
    model = ClusteredPCA(4, 3).fit(rows)
    held = model.reconstruct(np.arange(70))
    light = (rng.standard_normal((24, n_channels)) ** 3).astype(np.float32)
    squares = (held.astype(np.float64) ** 2).sum(axis=0) * light.astype(np.float64) ** 2
    for error in (0.3, 0.1, 0.03):
        quick = ClusterEvaluator(model, n_terms=None, error=error)
        wanted = []
        for channel in range(n_channels):
            order = np.sort(squares[:, channel])
            spare = (np.cumsum(order) < error**2 * order.sum()).sum()
            wanted.append(24 - int(spare))
        assert quick.terms(light) == wanted
        every = ClusterEvaluator(model, n_terms=None, error=0).product(light)
        left = np.linalg.norm(quick.product(light) - every) / np.linalg.norm(every)
        assert left < 2 * error
    few = ClusterEvaluator(model, n_terms=5, error=0)
    assert few.terms(light) == [5] * n_channels


def test_the_heaviest_terms_are_kept():
    weight = np.array([4.0, 0, 1, 9, 0.25, 0.04, 16])
    np.testing.assert_array_equal(heaviest(weight), [0, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(heaviest(weight, 3), [0, 3, 6])
    # Squares add up: 0.04 and 0.25 are a hundredth of 30.29, with 1 it is 0.21 of the root.
    np.testing.assert_array_equal(heaviest(weight, None, 0.1), [0, 2, 3, 6])
    np.testing.assert_array_equal(heaviest(weight, None, 0.22), [0, 3, 6])
    # The last is kept whatever is spared, and nothing of nothing.
    np.testing.assert_array_equal(heaviest(weight, None, 0.999), [6])
    assert len(heaviest(np.zeros(3))) == 0


def test_the_texels_that_are_looked_up_are_those_of_most_power(transport):
    # A texel in a face's corner has a fifth of the solid angle of one in its middle.
    size = transport.cube_map.solid_angles
    up = transport.cube_map.directions[:, 2] > 0.3
    large = np.flatnonzero(up)[size[up].argmax()]
    small = np.flatnonzero(up)[size[up].argmin()]
    light = np.full((transport.n_directions, 3), 0.01, np.float32)
    light[large], light[small] = (100, 90, 80), (150, 120, 100)
    assert size[large] * 100 > 1.3 * size[small] * 150
    model = ClusteredPCA(3, 1).fit(TransportRows(transport, 0))
    rest, one = light.copy(), np.zeros_like(light)
    rest[large], one[large] = 0, light[large]
    wanted = model.product(rest) + transport.product(one, bounces=0)
    result = ClusterEvaluator(model, transport, None, 0, n_exact=1).product(light)
    np.testing.assert_allclose(result, wanted, rtol=1e-4, atol=1e-5 * wanted.max())
    # None of them is looked up where it is not bright.
    even = np.ones_like(light)
    dim = ClusterEvaluator(model, transport, None, 0, n_exact=16, bright=0.01)
    np.testing.assert_allclose(dim.product(even), model.product(even), rtol=1e-4)
