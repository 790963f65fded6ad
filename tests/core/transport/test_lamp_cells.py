"""Which parts of lamps are seen, and samples that fall there."""

import numpy as np
import pytest

from prt_core.light import Lamp
from prt_core.light.lamp_rays import met
from prt_core.sphere import sobol_points
from prt_core.transport.lamp_cells import LampCells, cells_along, warped

SQUARE = Lamp("area", [1, 1, 1], (0, 0, 2))


def test_shares_are_of_the_rays_of_each_cell():
    uv, cells = sobol_points(8), LampCells(np.ones(4, bool), 4)
    half = (uv[:, 0] < 0.5).astype(float)
    cells.begin(slice(0, 3))
    for point, share in enumerate((half, 0 * half, 0 * half + 1)):
        cells.take(np.full(len(uv), point), uv, share)
    cells.end()
    cells.begin(slice(3, 4))
    # Of one cell nothing is known: it has the share of all others.
    known = (uv >= 0.25).any(axis=1)
    cells.take(np.full(known.sum(), 3), uv[known], 0 * half[known] + 0.4)
    cells.end()
    seen = cells.seen()
    shares = seen.of(np.arange(4))
    assert (shares[0, :2] == 1).all() and (shares[0, 2:] == 0).all()
    assert (shares[1] == 0).all() and (shares[2] == 1).all()
    np.testing.assert_allclose(shares[3], 0.4, atol=1e-6)
    between = seen.between(np.array([[0, 1, 2]]), np.array([[0.5, 0.25, 0.25]], np.float32))
    assert (between[0, :2] == 0.75).all() and (between[0, 2:] == 0.25).all()


def test_a_glimpse_of_a_cell_stays_one():
    uv, cells = np.tile([[0.1, 0.1]], (1000, 1)), LampCells(np.ones(1, bool), 8)
    cells.begin(slice(0, 1))
    cells.take(np.zeros(1000, int), uv, (np.arange(1000) == 0).astype(float))
    cells.end()
    assert cells.seen().of(np.array([0]))[0, 0, 0] > 0


def test_nothing_is_kept_where_all_or_nothing_is_seen():
    cells, uv = LampCells(np.ones(2, bool), 4), sobol_points(6)
    cells.begin(slice(0, 2))
    cells.take(np.zeros(len(uv), int), uv, np.ones(len(uv)))
    cells.take(np.ones(len(uv), int), uv, np.zeros(len(uv)))
    cells.end()
    assert cells.seen() is None


def test_cells_of_points_that_nobody_asked_for_are_not_kept():
    wanted, uv = np.array([False, True]), sobol_points(6)
    cells, half = LampCells(wanted, 4), (uv[:, 0] < 0.5).astype(float)
    cells.begin(slice(0, 2))
    cells.take(np.repeat([0, 1], len(uv)), np.tile(uv, (2, 1)), np.tile(half, 2))
    cells.end()
    shares = cells.seen().of(np.arange(2))
    assert (shares[0] == 1).all() and (shares[1, 2:] == 0).all()


def test_cells_without_rays_are_as_those_around():
    uv = sobol_points(8)
    uv = uv[(uv < 0.75).any(axis=1) | (uv > 0.875).any(axis=1)]
    cells, half = LampCells(np.ones(1, bool), 8), (uv[:, 0] < 0.5).astype(float)
    cells.begin(slice(0, 1))
    cells.take(np.zeros(len(uv), int), uv, half)
    cells.end()
    shares = cells.seen().of(np.array([0]))[0]
    assert (shares[:4] == 1).all() and (shares[4:] == 0).all()


def test_few_rays_tell_no_cells_apart():
    assert [cells_along(SQUARE, n) for n in (1, 63, 64, 256)] == [0, 0, 8, 16]
    assert cells_along(Lamp("point", [1, 1, 1]), 256) == 0
    assert cells_along(Lamp("area", [1, 1, 1], casts_shadow=False), 256) == 0


def test_samples_are_as_dense_as_shares():
    shares = np.random.default_rng(1).random((2, 4, 4))
    shares[1] = 0
    shares[1, 2, 3] = 1e-9
    uv = warped(np.tile(sobol_points(14), (2, 1, 1)), shares)
    for own, share in zip(uv, shares, strict=True):
        counts = np.histogram2d(*own.T, bins=4, range=[[0, 1], [0, 1]])[0]
        np.testing.assert_allclose(counts / len(own), share / share.sum(), atol=2e-3)
    same = sobol_points(5)
    np.testing.assert_allclose(warped(same[None], np.zeros((1, 8, 8)))[0], same, atol=1e-9)


@pytest.mark.parametrize("soft", [True, False])
def test_rays_meet_a_ball_where_samples_lie_on_it(soft):
    lamp, uv = (
        Lamp("point", [1, 1, 1], (0.5, 0.6, 1.4), radius=0.4, soft_falloff=soft),
        sobol_points(6),
    )
    places = np.random.default_rng(2).uniform(-1, 0, (len(uv), 3))
    ways, _, _ = lamp.sample(places, uv)
    back, density = met(lamp, places, ways)
    assert (density > 0).all()
    away = np.abs(back - uv)
    assert (
        away[:, 0].max() < 1e-6
        and np.minimum(away[:, 1], 1 - away[:, 1])[uv[:, 0] > 0].max() < 1e-6
    )
