"""A number of bounces that nobody needs ends as soon as nothing is added any more."""

import numpy as np
import pytest
import scipy.sparse as sp

from prt_core import PRTError
from prt_core.transport import Transport, all_bounces
from prt_core.transport.bounce import bounce_series

RNG = np.random.default_rng(2)
N_POINTS = 31


class Counted:
    """A matrix that counts its products."""

    def __init__(self, matrix):
        self.matrix, self.shape, self.count = matrix, matrix.shape, 0

    def __matmul__(self, light):
        self.count += 1
        return self.matrix @ light


def chain():
    """Light goes from each point to the next two, a little of it: dark ones are reached late."""
    rows = np.arange(N_POINTS)
    links = [np.full(N_POINTS - k, share, np.float32) for k, share in ((1, 0.5), (2, 0.4))]
    return sp.diags(links, [-1, -2], (len(rows),) * 2, format="csr", dtype=np.float32)


def meshed():
    share = RNG.random((N_POINTS, N_POINTS))
    return sp.csr_matrix((0.95 * share / share.sum(axis=1, keepdims=True)).astype(np.float32))


@pytest.mark.parametrize("gather", [chain(), meshed()], ids=["chain", "meshed"])
def test_a_million_bounces_are_those_that_add_something(gather):
    albedo = np.full((N_POINTS, 3), 0.9, np.float32)
    received = np.zeros((N_POINTS, 3), np.float32)
    received[0] = 1, 2, 3
    counted = Counted(gather)
    result, n_bounces = all_bounces(counted, albedo, received, bounces=1_000_000)
    assert n_bounces == counted.count < 400
    total = term = (albedo * received).astype(np.float64)
    for _ in range(3000):
        term = albedo * (gather @ term)
        total = total + term
    np.testing.assert_allclose(result, total, rtol=2e-6)
    # The last point of the chain is lit by the last of its bounces.
    assert (result[-1] > 0).all()


def test_a_number_that_matters_is_kept_to():
    gather, albedo = meshed(), np.full((N_POINTS, 1), 0.9, np.float32)
    received = RNG.random((N_POINTS, 1)).astype(np.float32)
    for bounces in (1, 2, 7):
        counted = Counted(gather)
        _, n_bounces = all_bounces(counted, albedo, received, bounces=bounces)
        assert n_bounces == counted.count == bounces


def test_light_that_never_settles_is_an_error_in_both_directions():
    ring = sp.csr_matrix(np.roll(np.eye(N_POINTS, dtype=np.float32), 1, axis=0))
    white, light = np.ones((N_POINTS, 3), np.float32), np.ones((N_POINTS, 3), np.float32)
    for bounces in (None, 1_000_000):
        with pytest.raises(PRTError, match="the light has not settled after"):
            all_bounces(ring, white, light, 1e-3, bounces)
    # What all receive grows by one with each bounce.
    assert all_bounces(ring, white, light, bounces=999)[0].max() == 1000
    from prt_core.sphere import CubeMap

    cube_map = CubeMap(1)
    bits = np.full((N_POINTS, 1), 63, np.uint8)
    up = np.tile(np.float32([0, 0, 1]), (N_POINTS, 1))
    transport = Transport(cube_map, bits, ring, up, white)
    with pytest.raises(PRTError, match="the light has not settled after 2,000 bounces"):
        transport.rows([3])


def test_the_series_backwards_is_the_transposed_one():
    gather, albedo = meshed(), RNG.random((N_POINTS, 1)).astype(np.float32)
    unit = np.eye(N_POINTS, dtype=np.float32)
    forth, _ = bounce_series(lambda t: albedo * (gather @ t), albedo * unit, albedo, 1e-7, 1000)
    back, _ = bounce_series(lambda t: gather.T @ (albedo * t), unit, albedo, 1e-7, 1000)
    np.testing.assert_allclose(forth, (albedo * back).T, rtol=1e-5, atol=1e-7)
