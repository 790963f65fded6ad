import numpy as np
import pytest

from prt_core import PRTError
from prt_core.evaluate import colour_error
from prt_core.light.prefilter import (
    PhongMap,
    ReflectionMap,
    SplitSum,
    environment_share,
    reflection_nodes,
)
from prt_core.reflectance import F82Tint, Microfacet, Phong, alphas, directional_albedo
from prt_core.sphere import CubeMap
from prt_core.transport.dense_gloss import dense_reflection, lobe_visibility

CUBE = CubeMap(16)


def some_points(n=60, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    outgoing = normals + 0.4 * rng.normal(size=(n, 3))
    outgoing /= np.linalg.norm(outgoing, axis=1, keepdims=True)
    above = np.packbits(normals @ CUBE.vectors.T > 0, axis=1, bitorder="little")
    return above, normals, outgoing


def sky(sun=50.0):
    d = CUBE.directions
    light = np.stack([1.1 + d[:, 2], 1 + 0.5 * np.sin(5 * d[:, 0]), 1 + 0.8 * d[:, 1]], axis=1)
    light[CUBE.texel_of([[0.3, 0.5, 0.8]])] += sun
    return light


def test_a_map_is_exact_at_its_crossings_and_has_no_seams():
    nodes = reflection_nodes(4)
    smooth = ReflectionMap(np.exp(nodes).astype(np.float64))
    np.testing.assert_allclose(smooth.at(3 * nodes.reshape(-1, 3)), np.exp(nodes).reshape(-1, 3))
    # Both sides of an edge of the cube.
    for near in (1e-9, -1e-9):
        np.testing.assert_allclose(
            smooth.at([[1 + near, 1, 0.25]]), smooth.at([[1, 1 + near, 0.25]]), atol=1e-7
        )


@pytest.mark.parametrize("exponent", [10, 20, 50])
def test_phong_without_shadows_is_the_dense_sum(exponent):
    above, normals, outgoing = some_points()
    wanted = dense_reflection(above, normals, CUBE, sky(), Phong(exponent).eval, outgoing)
    result = PhongMap(CUBE, exponent).set_light(sky()).toward(normals, outgoing)
    assert colour_error(result, wanted)["l2"] < 0.015


def test_a_factor_for_shadows_helps_and_is_not_enough():
    above, normals, outgoing = some_points()
    # Half of the sky is hidden, but not the sun.
    shown = np.packbits(CUBE.directions[:, 0] > 0, bitorder="little")
    bits = above & shown
    lobe = Phong(20).eval
    wanted = dense_reflection(bits, normals, CUBE, sky(), lobe, outgoing)
    form = PhongMap(CUBE, 20).set_light(sky())
    share = lobe_visibility(bits, normals, CUBE, lobe, outgoing)
    assert share.min() == 0 and share.max() == 1
    np.testing.assert_array_equal(lobe_visibility(above, normals, CUBE, lobe, outgoing), 1)
    without = colour_error(form.toward(normals, outgoing), wanted)["l2"]
    with_factor = colour_error(form.toward(normals, outgoing, share), wanted)["l2"]
    assert 0.02 < with_factor < 0.6 * without


def test_shares_of_the_split_sum_are_those_of_the_lobe():
    cosine = np.array([0.15, 0.5, 0.9])
    views = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=1)
    for roughness in (0.3, 0.7):
        scale, bias = environment_share(cosine, np.full(3, roughness))
        for f0 in (0.04, 0.8):
            lobe = Microfacet(*alphas(roughness), F82Tint(f0), multiple=False)
            wanted = directional_albedo(lobe, views)[:, 0]
            np.testing.assert_allclose(f0 * scale + bias, wanted, rtol=0.03)


def test_the_split_sum_is_near_where_the_light_is_soft():
    above, normals, outgoing = some_points()
    errors = []
    for sun in (0.0, 50.0):
        light = sky(sun)
        form = SplitSum(CUBE, (0.3, 0.5, 0.7), 16).set_light(light)
        lobe = Microfacet(*alphas(0.5), F82Tint((0.9, 0.6, 0.3)), multiple=False)
        wanted = dense_reflection(above, normals, CUBE, light, lobe.eval, outgoing)
        result = form.toward(normals, outgoing, 0.5, (0.9, 0.6, 0.3))
        errors.append(colour_error(result, wanted)["l2"])
    assert 0.01 < errors[0] < 0.03 and errors[1] < 0.04, errors
    assert form.nbytes == 3 * 6 * 17 * 17 * 3 * 4


def test_between_two_roughnesses_maps_are_mixed():
    _, normals, outgoing = some_points(5)
    form = SplitSum(CUBE, (0.3, 0.5), 8).set_light(np.ones((CUBE.n_directions, 3)))
    result = form.toward(normals, outgoing, np.linspace(0.3, 0.5, 5), 1.0)
    cosine = np.einsum("ni,ni->n", normals, outgoing)
    wanted = sum(environment_share(cosine, np.linspace(0.3, 0.5, 5)))
    np.testing.assert_allclose(result, wanted[:, None].repeat(3, axis=1), rtol=1e-5)
    np.testing.assert_array_equal(form.toward(normals, -outgoing, 0.4, 1.0), 0)


def test_what_does_not_fit_is_said():
    _, normals, outgoing = some_points(3)
    with pytest.raises(PRTError, match="light: none is set"):
        PhongMap(CUBE, 10).toward(normals, outgoing)
    with pytest.raises(PRTError, match="exponent: expected a number"):
        PhongMap(CUBE, -1)
    with pytest.raises(PRTError, match="roughness: expected one or more numbers that ascend"):
        SplitSum(CUBE, (0.5, 0.3))
    form = SplitSum(CUBE, (0.3, 0.5), 8).set_light(sky())
    with pytest.raises(PRTError, match="roughness: expected values from 0.3 to 0.5"):
        form.toward(normals, outgoing, 0.9, 1.0)
    with pytest.raises(PRTError, match="f0: expected numbers from 0 to 1"):
        form.toward(normals, outgoing, 0.4, 1.5)
    with pytest.raises(PRTError, match=r"values: expected \(6, n \+ 1, n \+ 1, ...\)"):
        ReflectionMap(np.ones((5, 3, 3)))
