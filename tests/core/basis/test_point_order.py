"""How points are sorted into patches: by place, side and object, whatever the scale."""

import numpy as np
import pytest

from prt_core.basis import PointHaar


def patches(transform, values, size):
    n = len(values) // size * size
    return values[transform.order[:n]].reshape(-1, size)


def test_the_two_sides_of_a_sheet_are_kept_apart():
    side = np.arange(16) / 16
    x, y = (part.ravel() for part in np.meshgrid(side, side))
    sheet = np.stack([x, y, 0 * x], axis=1)
    positions = np.concatenate([sheet, sheet])
    up = np.repeat([1.0, -1.0], 256)
    normals = up[:, None] * [0, 0, 1]
    mixed = np.abs(patches(PointHaar(positions, normals), up, 16).mean(axis=1)) < 1
    assert not mixed.any()
    # By place alone they are mixed.
    assert (np.abs(patches(PointHaar(positions), up, 16).mean(axis=1)) < 1).all()


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_neither_scale_nor_place_change_the_order(scale):
    rng = np.random.default_rng(0)
    positions, normals = rng.random((90, 3)) * [1, 2, 0.3], rng.standard_normal((90, 3))
    groups = rng.integers(0, 3, 90)
    plain = PointHaar(positions, normals, groups).order
    moved = PointHaar(scale * (positions + 3), normals, groups).order
    np.testing.assert_array_equal(moved, plain)


def test_nodes_are_cut_across_their_longest_axis():
    rng = np.random.default_rng(1)
    # A long box that leans: its halves and quarters lie one after another along it.
    axis = np.array([0.6, 0.0, 0.8])
    along = rng.permutation(64) / 64.0
    positions = along[:, None] * 5 * axis + 0.1 * rng.random((64, 3))
    for size in (32, 16, 8):
        parts = np.sort(patches(PointHaar(positions), along, size), axis=1)
        order = np.argsort(parts[:, 0])
        assert (parts[order][:-1, -1] < parts[order][1:, 0] + 0.05).all()
        assert np.ptp(parts, axis=1).max() < size / 64 + 0.05


def test_details_count_half_a_level_a_step():
    transform = PointHaar(np.random.default_rng(2).random((11, 3)))
    # 11 nodes become 6, 3, 2 and 1.
    sizes = [11, 6, 3, 2, 1]
    for depth in range(transform.depth + 1):
        scales = transform.scales(depth)
        assert (scales[: sizes[depth]] == 0).all()
        for level in range(depth):
            subset = scales[sizes[level + 1] : sizes[level]]
            assert (subset == -(-(depth - level) // 2)).all()
