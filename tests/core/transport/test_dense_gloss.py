import numpy as np
import pytest

from prt_core import PRTError
from prt_core.reflectance import Lambert, Phong
from prt_core.sphere import CubeMap
from prt_core.transport import received_light
from prt_core.transport.dense_gloss import dense_reflection

CUBE = CubeMap(8)


def some_points(n=7, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    outgoing = normals + 0.7 * rng.normal(size=(n, 3))
    outgoing /= np.linalg.norm(outgoing, axis=1, keepdims=True)
    seen = (rng.random((n, CUBE.n_directions)) < 0.6) & (normals @ CUBE.vectors.T > 0)
    bits = np.packbits(seen, axis=1, bitorder="little")
    return bits, normals, outgoing, rng.random((CUBE.n_directions, 3))


def test_a_diffuse_surface_sends_what_it_receives():
    bits, normals, _, light = some_points()
    # Texel centres below the horizon are black to the lobe, though part of the texel is above.
    bits &= np.packbits(normals @ CUBE.directions.T > 0, axis=1, bitorder="little")
    sent = dense_reflection(bits, normals, CUBE, light, Lambert(1.0).eval, normals)
    received = received_light(bits, normals.astype(np.float32), CUBE, light)
    np.testing.assert_allclose(sent, received, rtol=1e-5)


def test_phong_straight_above_has_a_closed_form():
    """Under even light a lobe about the normal reflects all that it is normalised to."""
    cube = CubeMap(32)
    normals = np.array([[0, 0, 1.0], [0.6, 0, 0.8]])
    bits = np.packbits(normals @ cube.vectors.T > 0, axis=1, bitorder="little")
    light = np.ones((cube.n_directions, 3))
    sent = dense_reflection(bits, normals, cube, light, Phong(20).eval, normals)
    np.testing.assert_allclose(sent, 1, rtol=2e-3)


def test_backs_are_black_and_blocks_do_not_matter(monkeypatch):
    bits, normals, outgoing, light = some_points(11, 3)
    outgoing[4] = -normals[4]
    whole = dense_reflection(bits, normals, CUBE, light, Phong(5).eval, outgoing)
    monkeypatch.setattr("prt_core.transport.dense_gloss._PAIRS", 1)
    alone = dense_reflection(bits, normals, CUBE, light, Phong(5).eval, outgoing)
    np.testing.assert_array_equal(whole, alone)
    assert not whole[4].any() and whole.any(axis=1).sum() >= 8


def test_each_point_may_have_a_lobe_of_its_own():
    bits, normals, outgoing, light = some_points(5, 1)
    strength = np.arange(5.0)

    def evaluate(incoming, outgoing, points):
        return strength[points, None] * Lambert(1.0).eval(incoming, outgoing)

    own = dense_reflection(bits, normals, CUBE, light, evaluate, outgoing, per_point=True)
    one = dense_reflection(bits, normals, CUBE, light, Lambert(1.0).eval, outgoing)
    np.testing.assert_allclose(own, strength[:, None] * one, rtol=1e-6)


def test_what_does_not_fit_is_said():
    bits, normals, outgoing, light = some_points()
    with pytest.raises(PRTError, match=r"outgoing: expected an array of shape \(7, 3\)"):
        dense_reflection(bits, normals, CUBE, light, Lambert(1.0).eval, outgoing[:3])
    with pytest.raises(PRTError, match="reflectance_eval: expected a callable"):
        dense_reflection(bits, normals, CUBE, light, 3, outgoing)
