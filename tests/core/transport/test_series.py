"""Rows, columns and blocks of T with so many bounces, against matrices written out."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from prt_core.sphere import CubeMap
from prt_core.transport import Transport, all_bounces
from prt_core.transport.visibility import unpack

N_POINTS, RESOLUTION = 11, 4


@pytest.fixture(scope="module")
def transport():
    """Random factors: every point sees some texels, and some of the others."""
    rng = np.random.default_rng(4)
    cube_map = CubeMap(RESOLUTION)
    normals = rng.standard_normal((N_POINTS, 3))
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    above = normals @ cube_map.vectors.T > 0
    seen = above & (rng.random(above.shape) < 0.7)
    gather = rng.random((N_POINTS, N_POINTS)) * (rng.random((N_POINTS, N_POINTS)) < 0.4)
    gather = (0.8 * gather / gather.sum(axis=1, keepdims=True).max()).astype(np.float32)
    albedo = rng.uniform(0.2, 0.9, (N_POINTS, 3)).astype(np.float32)
    bits = np.packbits(seen, axis=1, bitorder="little")
    return Transport(cube_map, bits, sp.csr_matrix(gather), normals, albedo, 1e-7)


def direct_of(transport):
    """D entry by entry."""
    vectors = transport.cube_map.vectors
    seen = unpack(transport.bits, transport.n_directions)
    result = np.zeros((N_POINTS, transport.n_directions))
    for x in range(N_POINTS):
        for d in range(transport.n_directions):
            if seen[x, d]:
                result[x, d] = transport.normals[x].astype(np.float64) @ vectors[d] / np.pi
    return result


def written_out(transport, bounces):
    """T channel by channel: A D + A K A D + ..., so many terms after the first."""
    direct, gather = direct_of(transport), transport.gather.toarray().astype(np.float64)
    result = np.empty((N_POINTS, transport.n_directions, 3))
    for channel in range(3):
        albedo = np.diag(transport.albedo[:, channel].astype(np.float64))
        if bounces is None:
            total = np.linalg.solve(np.eye(N_POINTS) - albedo @ gather, albedo @ direct)
        else:
            term = total = albedo @ direct
            for _ in range(bounces):
                term = albedo @ gather @ term
                total = total + term
        result[..., channel] = total
    return result


@pytest.mark.parametrize("bounces", [0, 1, 2, 3, None])
def test_rows_columns_and_relighting_have_the_same_bounces(transport, bounces):
    transport = replace(transport, bounces=bounces)
    wanted = written_out(transport, bounces)
    every, subset = np.arange(N_POINTS), np.array([7, 0, 3])
    atol = 1e-6 * wanted.max()
    np.testing.assert_allclose(transport.rows(subset), wanted[subset], rtol=1e-4, atol=atol)
    directions = np.array([90, 2, 41, 8, 7])
    result = transport.columns(directions)
    np.testing.assert_allclose(result, wanted[:, directions], rtol=1e-4, atol=atol)
    light = np.random.default_rng(0).random((transport.n_directions, 3)).astype(np.float32)
    truth = np.einsum("pdc,dc->pc", wanted, light)
    np.testing.assert_allclose(transport.radiance(light), truth, rtol=1e-4)
    np.testing.assert_allclose(transport.rows(every), wanted, rtol=1e-4, atol=atol)
    direct = transport.albedo[:, None] * direct_of(transport)[..., None]
    for result in (
        transport.rows(every, indirect=False),
        transport.columns(np.arange(transport.n_directions), indirect=False),
    ):
        np.testing.assert_allclose(result, direct, rtol=1e-4, atol=atol)
    np.testing.assert_allclose(
        transport.radiance(light, bounces=0), np.einsum("pdc,dc->pc", direct, light), rtol=1e-4
    )


def test_the_series_ends_when_what_is_left_is_below_the_tolerance(transport):
    received = np.random.default_rng(1).random((N_POINTS, 3)).astype(np.float32)
    gather, albedo = transport.gather, transport.albedo
    exact, _ = all_bounces(gather, albedo, received, 1e-7)
    counts = []
    for tolerance in (1e-2, 1e-3, 1e-4):
        result, count = all_bounces(gather, albedo, received, tolerance)
        missing = (exact - result).sum() / exact.sum()
        # Near the tolerance, and not many bounces more than it needs.
        assert -1e-6 < missing <= tolerance
        shorter, same = all_bounces(gather, albedo, received, bounces=max(count - 3, 1))
        assert same == max(count - 3, 1)
        assert (exact - shorter).sum() / exact.sum() > tolerance
        counts.append(count)
        # The adjoint series of rows ends by the same rule.
        rows = replace(transport, tolerance=tolerance).rows(np.arange(N_POINTS))
        wanted = written_out(transport, None)
        assert -1e-6 < (wanted - rows).sum() / wanted.sum() <= tolerance
    assert counts == sorted(counts) and counts[0] < counts[-1]


def test_grey_light_on_grey_surfaces_is_made_once_and_is_the_same(transport):
    grey = replace(transport, materials=np.repeat(transport.albedo[:, :1], 3, axis=1))
    light = np.random.default_rng(0).random((transport.n_directions, 1)).astype(np.float32)
    wanted = np.einsum("pdc,d->pc", written_out(grey, None), light[:, 0])
    result = grey.radiance(light * np.ones(3, np.float32))
    np.testing.assert_allclose(result, wanted, rtol=1e-4)
    np.testing.assert_array_equal(result, result[:, :1] * np.ones(3, np.float32))
    # Coloured light on grey surfaces, and grey light on surfaces of which two channels agree.
    coloured = light * np.float32([1, 0.5, 0.1])
    wanted = np.einsum("pdc,dc->pc", written_out(grey, None), coloured)
    np.testing.assert_allclose(grey.radiance(coloured), wanted, rtol=1e-4)
    albedo = grey.albedo.copy()
    albedo[:, 2] = transport.albedo[:, 2]
    two = replace(grey, materials=albedo)
    wanted = written_out(two, None)
    np.testing.assert_allclose(
        two.radiance(light * np.ones(3, np.float32)),
        np.einsum("pdc,d->pc", wanted, light[:, 0]),
        rtol=1e-4,
    )
    np.testing.assert_allclose(two.rows([5]), wanted[[5]], rtol=1e-4, atol=1e-6 * wanted.max())
    np.testing.assert_allclose(
        two.columns([40]), wanted[:, [40]], rtol=1e-4, atol=1e-6 * wanted.max()
    )


def test_light_of_lamps_is_added_and_bounced(transport):
    rng = np.random.default_rng(3)
    light = rng.random((transport.n_directions, 3)).astype(np.float32)
    lamps = rng.random((N_POINTS, 3)).astype(np.float32)
    gather = transport.gather.toarray().astype(np.float64)
    wanted = np.empty((N_POINTS, 3))
    for channel in range(3):
        albedo = np.diag(transport.albedo[:, channel].astype(np.float64))
        received = albedo @ lamps[:, channel]
        wanted[:, channel] = np.linalg.solve(np.eye(N_POINTS) - albedo @ gather, received)
    np.testing.assert_allclose(transport.radiance(None, lamps), wanted, rtol=1e-4)
    result = transport.radiance(light, lamps)
    np.testing.assert_allclose(result, transport.radiance(light) + wanted, rtol=1e-4)
    np.testing.assert_allclose(
        transport.radiance(None, lamps, bounces=0), transport.albedo * lamps, rtol=1e-6
    )
