import numpy as np
import pytest
import scipy.sparse as sp

from prt_core import CubeMap, PRTError, Scene, Transport
from prt_core.transport import PartialTransport, SpreadGather, visibility_bits
from prt_core.transport.visibility import received_light, vector_light
from tests.meshes import caster_of, plane, sphere

MAP = CubeMap(6)


@pytest.fixture(scope="module")
def whole():
    """A transport, and a random K of few entries."""
    scene = Scene.from_meshes([sphere(5, 0.4, (0, 0, 0.5), name="ball"), plane(7, albedo=0.7)])
    caster, n = caster_of(scene), len(scene.points)
    bits = visibility_bits(scene, MAP, caster, slice(None))
    gather = sp.random(n, n, 0.02, "csr", np.float32, np.random.default_rng(2))
    gather = (gather / gather.sum(axis=1).max()).astype(np.float32)
    points = scene.points
    return Transport(MAP, bits, gather, points.normals, points.materials)


@pytest.fixture(scope="module")
def light():
    return np.random.default_rng(3).random((MAP.n_directions, 3), np.float32)


def partial(whole, known, spread, **more):
    return PartialTransport(
        MAP, whole.bits[known], whole.gather, whole.normals, whole.materials, spread=spread, **more
    )


def test_a_vector_along_the_normal_is_what_is_received(whole, light):
    vectors = vector_light(whole.bits, MAP, light)
    along = np.maximum(np.einsum("pa,pac->pc", whole.normals, vectors), 0)
    np.testing.assert_allclose(
        along, received_light(whole.bits, whole.normals, MAP, light), atol=1e-6
    )


def test_with_all_rows_it_is_the_transport(whole, light):
    every = partial(whole, slice(None), None)
    np.testing.assert_array_equal(every.radiance(light), whole.radiance(light))
    same = partial(whole, slice(None), sp.identity(whole.n_points, np.float32, "csr"))
    np.testing.assert_allclose(same.radiance(light), whole.radiance(light), rtol=1e-5, atol=1e-6)
    assert same.is_coarse and not every.is_coarse and not whole.is_coarse


def test_a_neighbour_takes_what_falls_onto_its_own_normal(whole, light):
    upper = np.argmax(whole.normals[:, 2])
    n = whole.n_points
    spread = sp.csr_matrix((np.ones(n, np.float32), (np.arange(n), np.zeros(n, int))), (n, 1))
    received = partial(whole, [upper], spread).received(light)
    vector = vector_light(whole.bits[[upper]], MAP, light)[0]
    np.testing.assert_allclose(received, np.maximum(whole.normals @ vector, 0), atol=1e-6)
    grey = np.repeat(light[:, :1], 3, axis=1)
    one = partial(whole, [upper], spread).received(grey)
    np.testing.assert_allclose(one, np.repeat(one[:, :1], 3, axis=1))


def test_rows_may_have_fewer_directions(whole):
    coarse = CubeMap(3)
    n_bytes = -(-coarse.n_directions // 8)
    open_sky = np.packbits(np.ones((1, coarse.n_directions), bool), axis=1, bitorder="little")
    n = whole.n_points
    spread = sp.csr_matrix(np.ones((n, 1), np.float32))
    assert open_sky.shape == (1, n_bytes)
    transport = PartialTransport(
        MAP, open_sky, None, whole.normals, whole.materials, spread=spread, row_map=coarse
    )
    # Of light that comes from one side alone: what all of it brings is the same.
    side = np.maximum(MAP.directions[:, :1], 0).astype(np.float32)
    wanted = vector_light(np.full((1, -(-MAP.n_directions // 8)), 255, np.uint8), MAP, side)[0]
    received = transport.received(np.repeat(side, 3, axis=1))
    np.testing.assert_allclose(
        received[:, 0], np.maximum(whole.normals @ wanted, 0)[:, 0], atol=0.03
    )


def test_gathered_light_is_spread(whole):
    rng = np.random.default_rng(4)
    spread, gather = (
        sp.random(*shape, 0.3, "csr", np.float32, rng) for shape in ((40, 6), (6, 40))
    )
    term = rng.random((40, 3), np.float32)
    both = SpreadGather(spread, gather)
    assert both.shape == (40, 40)
    np.testing.assert_allclose(both @ term, (spread @ gather) @ term, rtol=1e-5)


def test_what_does_not_fit_is_named(whole):
    with pytest.raises(PRTError, match="spread: expected a sparse matrix"):
        partial(whole, [0, 1], sp.identity(3, format="csr"))
    with pytest.raises(PRTError, match="bits: expected"):
        PartialTransport(MAP, whole.bits, None, whole.normals, whole.materials, row_map=CubeMap(5))
    with pytest.raises(PRTError, match="row_map"):
        partial(whole, [0], None, row_map=5)
