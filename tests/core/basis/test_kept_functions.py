"""Which functions a node of points keeps: the constant, and the two that vary most in it."""

import numpy as np
import pytest

from prt_core.basis import PointMultiwavelet


def transform_of(n, strong, seed=0):
    """Points of which two of six features, of normals and places, vary much more than others."""
    rng = np.random.default_rng(seed)
    features = rng.uniform(-3, 3, (n, 6))
    features[:, strong] = rng.uniform(-127, 127, (n, 2))
    order = rng.permutation(n)
    return PointMultiwavelet.from_order(order, np.rint(features).astype(np.int8))


@pytest.mark.parametrize("strong", [(0, 1), (2, 5), (4, 5)])
def test_what_varies_most_has_no_details(strong):
    transform = transform_of(96, list(strong))
    features = transform.features.T.astype(np.float64)
    for depth in range(2, transform.depth + 1):
        details = transform.scales(depth) > 0
        for feature in range(6):
            coefficients = transform.forward(features[feature][None], depth)[0]
            share = np.linalg.norm(coefficients[details]) / np.linalg.norm(coefficients)
            if feature in strong:
                assert share < 1e-9
            else:
                assert share > 0.3


def test_a_constant_is_the_first_of_what_is_kept():
    transform = transform_of(64, [1, 3])
    coefficients = transform.forward(np.full((1, 64), 2.0))[0]
    assert abs(coefficients[0]) == pytest.approx(2 * np.sqrt(64))
    assert np.abs(coefficients[1:]).max() < 1e-9


def test_normals_and_places_are_told_in_like_steps():
    # A sphere's normals are its places: 127ths of both, so that neither is finer.
    rng = np.random.default_rng(1)
    normals = rng.standard_normal((500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals[:6] = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    features = PointMultiwavelet(7 + 3 * normals, normals).features
    np.testing.assert_array_equal(features[:, :3], np.rint(127 * normals))
    assert np.abs(features[:, 3:] - features[:, :3].astype(int)).max() <= 1
